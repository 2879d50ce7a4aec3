//! OASIS files made record by record.

use metalith_oasis::{CompressedBlock, MAGIC, OasisItem, OasisLimits, OasisReader, Placing, RecordBuffer, Repetition};
use rand::RngExt;

/// Limits small enough that the worst a mutant can ask for is done in milliseconds.
pub const LIMITS: OasisLimits = OasisLimits {
    string_bytes: 1 << 12,
    points: 1 << 12,
    list_places: 1 << 12,
    values: 1 << 8,
    farthest: i32::MAX as i64,
    short_file_unpacked: 1 << 18,
    unpacked_per_byte: 0,
};

/// These records in a CBLOCK.
pub fn block(records: &[u8]) -> Vec<u8> {
    use flate2::{Compression, write::DeflateEncoder};
    use std::io::Write;
    let mut deflate = DeflateEncoder::new(Vec::new(), Compression::best());
    deflate.write_all(records).expect("memory grows");
    let packed = deflate.finish().expect("memory grows");
    let mut bytes = vec![34, 0];
    for mut value in [records.len(), packed.len()] {
        while value >= 0x80 {
            bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        bytes.push(value as u8);
    }
    bytes.extend(packed);
    bytes
}

/// A file of these records on a grid of 1 nm, with no offsets of tables and no checksum, so that damage to the records
/// is found by what reads them.
pub fn around(records: &[u8]) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    // START: version, 1000 steps a micrometre, offsets in END.
    bytes.extend(b"\x01\x031.0\x00\xe8\x07\x01");
    bytes.extend(records);
    // END: no offsets, 240 bytes of padding, no checksum.
    bytes.push(2);
    bytes.extend([0; 12]);
    bytes.extend([0xF0, 1]);
    bytes.resize(bytes.len() + 241, 0);
    bytes
}

/// Cells with everything that the writer writes and much of what it does not.
pub fn corpus() -> Vec<Vec<u8>> {
    let grid = Repetition::Grid {
        count: [4, 3],
        step: [[350, 0], [0, 350]],
    };
    let list = Repetition::List {
        grid: 350,
        places: vec![[1, 0], [2, 1], [-3, 7]],
    };
    let column = Repetition::List {
        grid: 1,
        places: vec![[0, 350], [0, 1400]],
    };
    let mut shapes = RecordBuffer::relative();
    for k in 0..8 {
        shapes.rectangle(
            [1, 0],
            [350 * k, 0],
            [100 + 2 * k, 100 + 2 * k],
            Some(&grid).filter(|_| k % 3 == 0),
        );
    }
    shapes.rectangle([1, 0], [0, 9000], [100, 100], Some(&list));
    shapes.rectangle([1, 0], [0, 20_000], [100, 50], Some(&column));
    shapes.polygon([2, 0], &[[0, 0], [50, 0], [50, 50], [0, 50]], None);
    shapes.polygon([2, 0], &[[0, 0], [50, 10], [40, 50], [-7, 50]], Some(&list));
    shapes.path([3, 1], 20, [20, -5], &[[0, 0], [500, 0], [500, 900]], None);
    shapes.circle([3, 1], [7, 7], 400, Some(&grid));
    shapes.text([4, 0], 0, [5, 5], None);
    let turned = Placing {
        mirrored: true,
        magnification: 1.0,
        angle_deg: 270.0,
    };
    let skewed = Placing {
        mirrored: false,
        magnification: 1.5,
        angle_deg: 30.0,
    };
    let mut top = RecordBuffer::absolute();
    top.placement(0, [0, 0], &Placing::PLAIN, None);
    top.placement(0, [50_000, 0], &turned, Some(&grid));
    top.placement(0, [0, 90_000], &skewed, Some(&list));
    let names: &[u8] = b"\x03\x04LENS\x1c\x15\x01P\x08\x05\x03\x03TOP\x05\x05label\x07\x01P";
    let lens = [&[13, 0], shapes.bytes()].concat();
    let top = [&[13, 1], top.bytes()].concat();
    let rest = [
        &[23, 0x7B, 1, 0, 100, 40, 20, 41, 0, 0][..],
        &[26, 0xDB, 1, 0, 16, 50, 0, 0],
        &[28, 0xF4, 1, b'Q', 4, 0, 7, 9, 7, 10, 1, b'x', 13, 3, 29],
        &[33, 0x1B, 9, 1, 0, 1, b'?', 0, 0, 32, 9, 0],
        &[30, 5, 1, b'X', 11, 1, b'L', 3, 1, 4, 0, 9],
    ]
    .concat();
    let packed = CompressedBlock::of(&lens, 6);
    vec![
        [names, &lens, &top].concat(),
        [&lens[..], &rest, &top, names].concat(),
        [&lens[..], &top, &rest, names].concat(),
        vec![0; packed.length()],
    ]
}

/// A damaged file: records changed, and then in a CBLOCK or not; or a file changed as it is.
pub fn mutant<R: RngExt>(rng: &mut R, corpus: &[Vec<u8>]) -> Vec<u8> {
    let compressed = rng.random_range(0..4) == 0;
    let file = |records: &[u8]| {
        if compressed {
            around(&block(records))
        } else {
            around(records)
        }
    };
    if rng.random_range(0..4) == 0 {
        let whole: Vec<Vec<u8>> = corpus.iter().map(|records| file(records)).collect();
        return super::mutate::mutate(rng, &whole);
    }
    file(&super::mutate::mutate(rng, corpus))
}

/// Read all records. Whether they can be read; an error must name a place in the file.
pub fn survives(bytes: &[u8]) -> bool {
    let read = || {
        let mut reader = OasisReader::new(std::io::Cursor::new(bytes), LIMITS)?;
        while !matches!(reader.read_item()?, OasisItem::End) {}
        Ok(())
    };
    match read() {
        Ok(()) => true,
        Err(metalith_oasis::OasisError::Fault { offset, fault, .. }) => {
            assert!(offset <= bytes.len() as u64, "{fault}: byte {offset}");
            assert!(!fault.to_string().is_empty() && !fault.remedy().is_empty());
            false
        }
        Err(error) => panic!("{error}"),
    }
}
