//! PNG files that the encoder of the tests does not write: interlaced ones.

use crate::damage::chunk;

/// First column and row, and steps along both, of the passes of an interlaced picture (PNG specification, section 8.2).
const PASSES: [[usize; 4]; 7] = [
    [0, 0, 8, 8],
    [4, 0, 8, 8],
    [0, 4, 4, 8],
    [2, 0, 4, 4],
    [0, 2, 2, 4],
    [1, 0, 2, 2],
    [0, 1, 1, 2],
];

/// Kinds of pixels, as a header numbers them.
pub(crate) const GREY: u8 = 0;
pub(crate) const COLOUR: u8 = 2;
pub(crate) const PALETTE: u8 = 3;
pub(crate) const COLOUR_AND_OPACITY: u8 = 6;

/// An interlaced PNG of 8 or 16 bits, its numbers not compressed.
pub(crate) fn interlaced([width, height]: [usize; 2], kind: u8, bits: u8) -> Vec<u8> {
    let bytes = usize::from(bits / 8) * if kind == COLOUR { 3 } else { 1 };
    let mut rows = Vec::new();
    for [x0, y0, dx, dy] in PASSES {
        for y in (y0..height).step_by(dy) {
            // No filter.
            rows.push(0);
            let pixels = (x0..width).step_by(dx);
            rows.extend(pixels.flat_map(|x| (0..bytes).map(move |k| ((7 * x + 5 * y + k) % 251 + 1) as u8)));
        }
    }
    let mut head = [(width as u32).to_be_bytes(), (height as u32).to_be_bytes()].concat();
    head.extend([bits, kind, 0, 0, 1]);
    let palette: Vec<u8> = (0..3 * 256).map(|k| (k * 11 % 256) as u8).collect();
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    out.extend(chunk(b"IHDR", &head));
    if kind == PALETTE {
        out.extend(chunk(b"PLTE", &palette));
    }
    out.extend(chunk(b"IDAT", &stored(&rows)));
    out.extend(chunk(b"IEND", b""));
    out
}

/// A stream of zlib that stores bytes as they are.
pub(crate) fn stored(bytes: &[u8]) -> Vec<u8> {
    /// Most bytes of a block.
    const BLOCK: usize = u16::MAX as usize;
    let mut out = vec![0x78, 0x01];
    let blocks = bytes.chunks(BLOCK).count();
    for (k, block) in bytes.chunks(BLOCK).enumerate() {
        let length = block.len() as u16;
        out.push(u8::from(k + 1 == blocks));
        out.extend([length.to_le_bytes(), (!length).to_le_bytes()].concat());
        out.extend(block);
    }
    out.extend(adler(bytes).to_be_bytes());
    out
}

/// Checksum of a stream of zlib (Adler-32).
fn adler(bytes: &[u8]) -> u32 {
    /// Largest prime below 2^16.
    const PRIME: u32 = 65_521;
    let (a, b) = bytes.iter().fold((1, 0), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % PRIME;
        (a, (b + a) % PRIME)
    });
    b << 16 | a
}
