//! Damage to files.

use metalith::text::hex;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

use super::formats::{Format, Kind};
use super::json::text_or_json;

/// Bytes of the checksum at the end of sealed files.
const CHECKSUM: usize = 32;

/// Letters around the SHA-256, in hexadecimal, of all that precedes it.
pub(crate) struct Ending {
    before: &'static str,
    after: &'static str,
    /// End of the text without a digest.
    plain: &'static str,
}

/// End of a shard: a line.
pub(crate) const SHARD_ENDING: Ending = Ending {
    before: "{\"sha256\":\"",
    after: "\"}\n",
    plain: "",
};

/// End of the manifest of a plan: its last field.
pub(crate) const PLAN_ENDING: Ending = Ending {
    before: ",\n  \"sha256\": \"",
    after: "\"\n}\n",
    plain: "\n}\n",
};

impl Ending {
    /// A text with its digest.
    pub(crate) fn sealed(&self, text: &[u8]) -> Vec<u8> {
        let text = text.strip_suffix(self.plain.as_bytes()).unwrap_or(text);
        let digest = format!("{}{}{}", self.before, hex(&Sha256::digest(text)), self.after);
        [text, digest.as_bytes()].concat()
    }

    /// A text without its digest.
    fn bare(&self, text: &[u8]) -> Vec<u8> {
        let around = self.before.len() + 2 * CHECKSUM + self.after.len();
        [&text[..text.len() - around], self.plain.as_bytes()].concat()
    }
}

/// Values that programs stumble over, in place of a number or a word.
pub(crate) const VALUES: [&str; 26] = [
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
    "\"/dev/zero\"",
    "123456789012345678",
    "0.000000000000000001",
    "4294967296",
    "65537",
    "-1e-308",
    "null",
    "\"\u{202e}\u{1b}[2J\"",
    "[[[[]]]]",
];

/// A mutant of one of the files of a format.
pub(crate) fn mutant(rng: &mut ChaCha8Rng, format: &Format) -> Vec<u8> {
    let corpus = &format.corpus;
    match format.kind {
        Kind::Bytes => bytes(rng, corpus),
        _ if rng.random_range(0..3) == 0 => bytes(rng, corpus),
        Kind::Text => text(rng, corpus),
        Kind::Json => text_or_json(rng, corpus, false),
        Kind::Sealed => sealed(rng, corpus),
        Kind::Ended(ending) => {
            let bare: Vec<_> = corpus.iter().map(|b| ending.bare(b)).collect();
            ending.sealed(&text_or_json(rng, &bare, ending.plain.is_empty()))
        }
        Kind::Png => png(rng, corpus),
        Kind::Safetensors => safetensors(rng, corpus),
    }
}

/// Bytes that are changed, lost, doubled, moved and taken from another file.
fn bytes(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    if rng.random_range(0..2) == 0 {
        in_place(rng, corpus)
    } else {
        metalith_testing::mutate::mutate(rng, corpus)
    }
}

/// Bytes and numbers that are others, at their places: what stands behind is found, so that readers go on to judge it.
fn in_place(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    /// Numbers at the ends of their ranges, and small ones.
    const NUMBERS: [u32; 9] = [0, 1, 2, 16, 0xFFFF, 0x1_0000, 0x7FFF_FFFF, 0x8000_0000, u32::MAX];
    let mut bytes = corpus[rng.random_range(0..corpus.len())].clone();
    if bytes.is_empty() {
        return bytes;
    }
    for _ in 0..rng.random_range(1..=4) {
        let at = rng.random_range(0..bytes.len());
        let number = NUMBERS[rng.random_range(0..NUMBERS.len())];
        let new = match rng.random_range(0..5) {
            0 => vec![rng.random()],
            1 => vec![bytes[at] ^ 1 << rng.random_range(0..8)],
            2 => (number as u16).to_le_bytes().to_vec(),
            3 => number.to_le_bytes().to_vec(),
            _ => number.to_be_bytes().to_vec(),
        };
        bytes[at..].iter_mut().zip(new).for_each(|(to, byte)| *to = byte);
    }
    bytes
}

/// Damage to the content of a chunk of a PNG, with the checksum of that; or a chunk lost or doubled.
fn png(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    /// Bytes before the first chunk; of length and name; of the checksum.
    const BEFORE: usize = 8;
    const HEAD: usize = 8;
    const AFTER: usize = 4;
    let whole = &corpus[rng.random_range(0..corpus.len())];
    let mut chunks = Vec::new();
    let mut rest = &whole[BEFORE..];
    while let Some((head, tail)) = rest.split_at_checked(HEAD) {
        let length = u32::from_be_bytes(head[..4].try_into().unwrap()) as usize;
        chunks.push((head[4..].to_vec(), tail[..length].to_vec()));
        rest = &tail[length + AFTER..];
    }
    for _ in 0..rng.random_range(1..=2) {
        let at = rng.random_range(0..chunks.len());
        match rng.random_range(0..8) {
            0 => drop(chunks.remove(at)),
            1 => chunks.insert(rng.random_range(0..=chunks.len()), chunks[at].clone()),
            _ if chunks[at].1.is_empty() => {}
            _ => chunks[at].1 = bytes(rng, &[chunks[at].1.clone()]),
        }
        if chunks.is_empty() {
            break;
        }
    }
    let mut out = whole[..BEFORE].to_vec();
    for (name, content) in chunks {
        out.extend(chunk(&name, &content));
    }
    out
}

/// A chunk of a PNG with its length and checksum.
pub(crate) fn chunk(name: &[u8], content: &[u8]) -> Vec<u8> {
    let checked = [name, content].concat();
    let length = (content.len() as u32).to_be_bytes();
    [&length[..], &checked, &checksum(&checked).to_be_bytes()].concat()
}

/// Checksum of a chunk of a PNG (CRC-32).
fn checksum(bytes: &[u8]) -> u32 {
    /// The polynomial, lowest power first.
    const POLYNOMIAL: u32 = 0xEDB8_8320;
    let step = |crc: u32, _| (crc >> 1) ^ if crc & 1 == 1 { POLYNOMIAL } else { 0 };
    !bytes.iter().fold(!0, |crc, b| (0..8).fold(crc ^ u32::from(*b), step))
}

/// Damage to the values of the header of a file of safetensors, with its length before it.
fn safetensors(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    let whole = &corpus[rng.random_range(0..corpus.len())];
    let (length, rest) = whole.split_first_chunk().unwrap();
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let header = text_or_json(rng, &[header.to_vec()], false);
    [&(header.len() as u64).to_le_bytes()[..], &header, data].concat()
}

/// Damage within what a checksum covers, and the checksum of that: what a reader must judge by its content.
fn sealed(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    let bodies: Vec<_> = corpus.iter().map(|b| b[..b.len() - CHECKSUM].to_vec()).collect();
    let mut bytes = bytes(rng, &bodies);
    let digest = Sha256::digest(&bytes);
    bytes.extend(digest);
    bytes
}

/// Letters between words.
const BETWEEN: &str = " ,=[]:{}();\t";

/// Lines lost, doubled, moved, very long and taken from another file; keys with other names; values that are something else or
/// nested.
pub(crate) fn text(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    /// Most repeats of a line.
    const REPEATS: usize = 200;
    /// Length of a line that is long for any reader (bytes); it costs time, so that only one repeat in so many has it.
    const LONG: usize = 1 << 20;
    const RARE: usize = 400;
    let of = |k: usize| {
        String::from_utf8_lossy(&corpus[k])
            .lines()
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    let k = rng.random_range(0..corpus.len());
    let mut lines = of(k);
    if corpus[k].ends_with(b"\n") {
        // The end of the last line stays: before a digest the reader needs it.
        lines.push(String::new());
    }
    for _ in 0..rng.random_range(1..=3) {
        if lines.is_empty() {
            break;
        }
        let at = rng.random_range(0..lines.len());
        match rng.random_range(0..10) {
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
            3 if rng.random_range(0..RARE) == 0 => lines[at] = lines[at].repeat(LONG / lines[at].len().max(1)),
            3 => {
                let most = REPEATS.min(LONG / lines[at].len().max(1));
                lines[at] = lines[at].repeat(rng.random_range(2..=most.max(2)));
            }
            4 => {
                let named = renamed(rng, &lines[at]);
                lines[at] = named;
            }
            5 => {
                let value = nested(rng);
                lines[at] = with_word(rng, &lines[at], &value);
            }
            _ => {
                let value = VALUES[rng.random_range(0..VALUES.len())];
                lines[at] = with_word(rng, &lines[at], value);
            }
        }
    }
    lines.join("\n").into_bytes()
}

/// A line with a word in place of one of its words.
fn with_word(rng: &mut ChaCha8Rng, line: &str, value: &str) -> String {
    let words: Vec<_> = line.split_inclusive(|c: char| BETWEEN.contains(c)).collect();
    let meaning = |w: &str| w.contains(|c: char| c.is_alphanumeric());
    let places: Vec<usize> = (0..words.len()).filter(|k| meaning(words[*k])).collect();
    let k = places
        .get(rng.random_range(0..places.len().max(1)))
        .copied()
        .unwrap_or(0);
    let end = words
        .get(k)
        .and_then(|w| w.chars().last())
        .filter(|c| BETWEEN.contains(*c));
    let word = format!("{value}{}", end.map_or_else(String::new, String::from));
    let all = words.iter().enumerate().map(|(i, w)| if i == k { &word } else { *w });
    all.collect()
}

/// A line whose key has a letter more, or one less.
fn renamed(rng: &mut ChaCha8Rng, line: &str) -> String {
    let begins: Vec<usize> = line
        .char_indices()
        .filter(|(_, c)| c.is_alphanumeric())
        .map(|(k, _)| k)
        .collect();
    let Some(at) = begins.get(rng.random_range(0..begins.len().max(1))) else {
        return line.to_owned();
    };
    let (before, after) = line.split_at(*at);
    if rng.random_range(0..2) == 0 {
        format!("{before}x{after}")
    } else {
        before.to_owned() + after.get(1..).unwrap_or_default()
    }
}

/// Brackets within brackets, closed or not.
fn nested(rng: &mut ChaCha8Rng) -> String {
    /// Most brackets: more than any stack of calls holds that takes one a bracket.
    const DEEPEST: usize = 20_000;
    let depth = DEEPEST >> rng.random_range(0..12);
    let (open, close) = [("[", "]"), ("(", ")"), ("{\"a\":", "}"), ("{a=", "}"), ("-", "")][rng.random_range(0..5)];
    let close = if rng.random_range(0..2) == 0 { close } else { "" };
    [open.repeat(depth).as_str(), "1", &close.repeat(depth)].concat()
}
