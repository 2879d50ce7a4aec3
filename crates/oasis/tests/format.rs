//! Files made byte by byte: what the standard allows and this crate's writer never writes, and what it forbids.

use std::io::Cursor;

use metalith_oasis::*;
use metalith_testing::oasis::{around, block};

/// Place in such a file of the first record.
const FIRST: u64 = 13 + 1 + 4 + 3 + 1;

/// A cell named A with these records.
fn cell(records: &[u8]) -> Vec<u8> {
    [b"\x0e\x01A", records].concat()
}

/// Corners of all polygons and rectangles, copies counted out.
fn outlines(bytes: &[u8]) -> Vec<Vec<[i64; 2]>> {
    let mut reader = OasisReader::new(Cursor::new(bytes), OasisLimits::default()).unwrap();
    let mut found = Vec::new();
    loop {
        match reader.read_item().unwrap() {
            OasisItem::Element(element) => {
                let corners = match element.shape {
                    OasisShape::Rectangle { size: [w, h] } => vec![[0, 0], [w, 0], [w, h], [0, h]],
                    OasisShape::Polygon { points } | OasisShape::Path { points, .. } => points.to_vec(),
                    _ => continue,
                };
                let mut copy = |[dx, dy]: [i64; 2]| {
                    let at = [element.at[0] + dx, element.at[1] + dy];
                    found.push(corners.iter().map(|c| [c[0] + at[0], c[1] + at[1]]).collect());
                    Ok::<_, ()>(())
                };
                match element.repetition {
                    Some(repetition) => repetition.each(copy).unwrap(),
                    None => copy([0, 0]).unwrap(),
                }
            }
            OasisItem::End => return found,
            _ => {}
        }
    }
}

fn fault(bytes: &[u8]) -> (u64, Option<u64>, OasisFault) {
    let limits = OasisLimits::default();
    let read = || {
        let mut reader = OasisReader::new(Cursor::new(bytes), limits)?;
        while !matches!(reader.read_item()?, OasisItem::End) {}
        Ok(())
    };
    match read() {
        Err(OasisError::Fault { offset, inner, fault }) => {
            assert!(!fault.to_string().is_empty() && !fault.remedy().is_empty());
            (offset, inner, fault)
        }
        Err(OasisError::Io(error)) => panic!("{error}"),
        Ok(()) => panic!("the file has a fault"),
        Err(other) => panic!("{other}"),
    }
}

fn fault_of(records: &[u8]) -> (u64, OasisFault) {
    let (offset, _, fault) = fault(&around(records));
    (offset, fault)
}

/// Layer 1/0, 10 x 10 at the origin; the rest from what follows.
const SQUARE: &[u8] = &[20, 0xDB, 1, 0, 10, 0, 0];
/// Record of a square with a repetition, whose bytes follow.
const SQUARES: &[u8] = &[20, 0xDF, 1, 0, 10, 0, 0];

fn corner_places(repetition: &[u8]) -> Vec<[i64; 2]> {
    let drawn = outlines(&around(&cell(&[SQUARES, repetition].concat())));
    drawn.iter().map(|corners| corners[0]).collect()
}

#[test]
fn all_repetitions() {
    let grid = [[0, 0], [20, 0], [40, 0], [0, 30], [20, 30], [40, 30]];
    assert_eq!(corner_places(&[1, 1, 0, 20, 30]), grid);
    assert_eq!(corner_places(&[2, 0, 20]), [[0, 0], [20, 0]]);
    assert_eq!(corner_places(&[3, 0, 20]), [[0, 0], [0, 20]]);
    assert_eq!(corner_places(&[4, 1, 20, 5]), [[0, 0], [20, 0], [25, 0]]);
    assert_eq!(corner_places(&[5, 1, 10, 2, 1]), [[0, 0], [20, 0], [30, 0]]);
    assert_eq!(corner_places(&[6, 1, 20, 5]), [[0, 0], [0, 20], [0, 25]]);
    assert_eq!(corner_places(&[7, 1, 10, 2, 1]), [[0, 0], [0, 20], [0, 30]]);
    // Steps east by 20 and north-west by 3 in one integer, then (-5, 7) in two.
    let (east, north_west, free) = ([0xC0, 2], [0x3A], [0x17, 14]);
    let skewed = corner_places(&[&[8, 0, 0], &east[..], &north_west].concat());
    assert_eq!(skewed, [[0, 0], [20, 0], [-3, 3], [17, 3]]);
    assert_eq!(
        corner_places(&[&[9, 1], &free[..]].concat()),
        [[0, 0], [-5, 7], [-10, 14]]
    );
    let list = corner_places(&[&[10, 1], &east[..], &free].concat());
    assert_eq!(list, [[0, 0], [20, 0], [15, 7]]);
    let list = corner_places(&[&[11, 1, 10], &north_west[..], &free].concat());
    assert_eq!(list, [[0, 0], [-30, 30], [-80, 100]]);
    // The last one again.
    let again = around(&cell(&[SQUARES, &[2, 0, 20], &[20, 0x14, 100, 0]].concat()));
    let corners: Vec<_> = outlines(&again).iter().map(|c| c[0]).collect();
    assert_eq!(corners, [[0, 0], [20, 0], [50, 0], [70, 0]]);
}

#[test]
fn all_point_lists() {
    let polygon = |list: &[u8]| outlines(&around(&cell(&[&[21, 0x3B, 1, 0], list, &[0, 0]].concat()))).remove(0);
    let square = [[0, 0], [10, 0], [10, 10], [0, 10]];
    assert_eq!(polygon(&[0, 2, 20, 20]), square);
    assert_eq!(polygon(&[1, 2, 20, 20]), [[0, 0], [0, 10], [10, 10], [10, 0]]);
    assert_eq!(polygon(&[2, 3, 40, 41, 42]), square);
    assert_eq!(polygon(&[3, 2, 80, 81]), [[0, 0], [10, 0], [10, 10]]);
    assert_eq!(polygon(&[3, 2, 84, 82]), [[0, 0], [10, 10], [0, 10]]);
    assert_eq!(polygon(&[4, 2, 0x29, 10, 0x2B, 10]), [[0, 0], [10, 5], [0, 10]]);
    // Each step is the one before and a change of it.
    assert_eq!(polygon(&[5, 2, 0x29, 10, 0x2B, 2]), [[0, 0], [10, 5], [10, 11]]);
}

#[test]
fn trapezoids() {
    // 100 x 40, leaning by 10 on the left and by -20 on the right.
    let level = outlines(&around(&cell(&[23, 0x7B, 1, 0, 100, 40, 20, 41, 0, 0])));
    assert_eq!(level[0], [[10, 40], [80, 40], [100, 0], [0, 0]]);
    let upright = outlines(&around(&cell(&[25, 0xFB, 1, 0, 100, 40, 20, 0, 0])));
    assert_eq!(upright[0], [[0, 0], [0, 40], [100, 30], [100, 0]]);
    let triangle = outlines(&around(&cell(&[26, 0xDB, 1, 0, 16, 50, 0, 0])));
    assert_eq!(triangle[0], [[0, 0], [0, 50], [50, 0]]);
    for form in 0..26 {
        let corners = compact_trapezoid(form, 50, 25)
            .or_else(|| compact_trapezoid(form, 25, 50))
            .unwrap();
        // Twice the area, clockwise: negative.
        let n = corners.len();
        let area: i64 = (0..n)
            .map(|k| (corners[k], corners[(k + 1) % n]))
            .map(|(a, b)| a[0] * b[1] - b[0] * a[1])
            .sum();
        assert!(area < 0, "form {form}: {corners:?}");
    }
    assert!(compact_trapezoid(4, 50, 26).is_none() && compact_trapezoid(26, 1, 1).is_none());
}

/// Relative places, widths and layers go on from record to record and over the ends of CBLOCKs, and end with the cell.
#[test]
fn modal_variables() {
    let second = [20, 0x18, 60, 4];
    let both = [SQUARE, &[16], &second].concat();
    let drawn = outlines(&around(&cell(&both)));
    assert_eq!(drawn[1], [[30, 2], [40, 2], [40, 12], [30, 12]]);
    let in_blocks = [cell(&[]), block(&[SQUARE, &[16]].concat()), block(&second)].concat();
    assert_eq!(outlines(&around(&in_blocks)), drawn);
    let in_next_cell = [cell(SQUARE), b"\x0e\x01B".to_vec(), second.to_vec()].concat();
    let (offset, fault) = fault_of(&in_next_cell);
    let what = "the layer";
    assert_eq!(fault, OasisFault::Undefined { kind: 20, what });
    assert_eq!(offset, FIRST + 3 + SQUARE.len() as u64 + 3);
}

/// Texts, circles, properties and what is private are handed out or stepped over.
#[test]
fn the_rest() {
    let records = [
        &[3, 1, b'A', 28, 0x14, 1, b'P', 8, 5][..],
        &[13, 0],
        &[19, 0x5B, 2, b'h', b'i', 7, 8, 2, 4],
        &[27, 0x3B, 1, 0, 50, 0, 0],
        &[28, 0xF4, 1, b'Q', 4, 0, 7, 9, 7, 10, 1, b'x', 13, 3, 29],
        &[22, 0xFB, 1, 0, 5, 0x0E, 9, 4, 1, 0xC0, 2, 0, 0],
        &[33, 0x1B, 9, 1, 0, 1, b'?', 0, 0, 32, 9, 0],
        &[18, 0xB7, 1, b'B', 6, 0, 0, 0, 0x40, 2, 4, 0, 0],
        &[30, 5, 1, b'X', 11, 1, b'L', 3, 1, 4, 0, 9],
    ]
    .concat();
    let bytes = around(&records);
    let mut reader = OasisReader::new(Cursor::new(&bytes), OasisLimits::default()).unwrap();
    let mut said = Vec::new();
    loop {
        match reader.read_item().unwrap() {
            OasisItem::End => break,
            OasisItem::Element(e) => said.push(format!("{:?} {} {} {:?}", e.shape, e.layer, e.datatype, e.at)),
            OasisItem::Property { name, values, .. } => said.push(format!("{name:?} {values:?}")),
            OasisItem::Cell(name) => said.push(format!("{name:?}")),
            OasisItem::Name(entry) => said.push(format!("{:?} {} {:?}", entry.table, entry.number, entry.name)),
        }
    }
    let expected = [
        "Cells 0 [65]",
        "Name([80]) [Unsigned(5)]",
        "Number(0)",
        "Text { string: Name([104, 105]) } 7 8 [1, 2]",
        "Circle { radius: 50 } 1 0 [0, 0]",
        "Name([81]) [Real(7.0), Signed(-3), Text([120]), TextNumber(3)]",
        "Name([81]) [Real(7.0), Signed(-3), Text([120]), TextNumber(3)]",
        "Path { points: [[0, 0], [20, 0]], half_width: 5, extensions: [-4, 5] } 1 0 [0, 0]",
        "Private { attribute: 9 } 1 0 [0, 0]",
        "Private { attribute: 9 } 1 0 [0, 0]",
        "Placement { cell: Name([66]), mirrored: true, magnification: 2.0, angle_deg: 0.25 } 0 0 [0, 0]",
        "Private 0 [88]",
        "Layers 0 [76]",
    ];
    assert_eq!(said, expected);
}

#[test]
fn faults_name_their_byte() {
    let at = FIRST + 3;
    assert_eq!(fault(b"HEADER").2, OasisFault::NoMagic);
    assert_eq!(fault_of(SQUARE), (FIRST, OasisFault::OutsideCells { kind: 20 }));
    assert_eq!(fault_of(&cell(&[35])), (at, OasisFault::RecordKind(35)));
    assert_eq!(fault_of(&cell(&[20, 0xDB, 0x81, 0])), (at, OasisFault::IntegerPadded));
    let endless = [&[20, 0x5B][..], &[0x80; 400]].concat();
    assert_eq!(fault_of(&cell(&endless)), (at, OasisFault::IntegerSize));
    assert_eq!(
        fault_of(&cell(&[20, 0xFB, 1, 0])),
        (at, OasisFault::Info { kind: 20, info: 0xFB })
    );
    assert_eq!(
        fault_of(&cell(&[SQUARES, &[12]].concat())),
        (at, OasisFault::RepetitionKind(12))
    );
    assert_eq!(
        fault_of(&cell(&[21, 0x3B, 1, 0, 0, 3, 2, 2, 2])),
        (at, OasisFault::Points { kind: 21, found: 3 })
    );
    assert_eq!(fault_of(&[3, 0]), (FIRST, OasisFault::EmptyName));
    assert_eq!(fault_of(&[3, 1, 7]), (FIRST, OasisFault::NameByte(7)));
    assert_eq!(
        fault_of(&[3, 1, b'A', 4, 1, b'B', 9]).1,
        OasisFault::MixedNumbers { table: "CELLNAME" }
    );
    assert_eq!(fault_of(&[34, 1]), (FIRST, OasisFault::Compression(1)));
    let whole = around(&cell(SQUARE));
    assert_eq!(fault(&whole[..30]).2, OasisFault::EndsEarly);
    let end = whole.len() as u64 - 256;
    let longer = [&whole[..], &[0]].concat();
    assert_eq!(fault(&longer), (end, None, OasisFault::EndPlace { before_end: 257 }));
    let mut unknown = whole.clone();
    unknown[end as usize + 255] = 3;
    assert_eq!(fault(&unknown), (end, None, OasisFault::Validation(3)));
}

#[test]
fn faults_in_blocks_name_both_bytes() {
    let head = cell(&[]).len() as u64;
    let nested = [cell(&[]), block(&[SQUARE, &block(SQUARE)].concat())].concat();
    let inner = SQUARE.len() as u64;
    let expected = (FIRST + head, Some(inner), OasisFault::InBlock { kind: 34 });
    assert_eq!(fault(&around(&nested)), expected);
    let cut = [cell(&[]), block(&SQUARE[..5])].concat();
    assert_eq!(fault(&around(&cut)), (FIRST + head, Some(0), OasisFault::EndsInRecord));
    // It says one byte less, and one more, than it holds.
    for (said, more) in [(6, true), (8, false)] {
        let mut wrong = block(SQUARE);
        wrong[2] = said;
        let said = said.into();
        let expected = (FIRST + head, None, OasisFault::BlockLength { said, more });
        assert_eq!(fault(&around(&[cell(&[]), wrong].concat())), expected);
    }
    let mut broken = block(&[0; 3000]);
    broken[6] ^= 0xFF;
    assert!(matches!(
        fault(&around(&broken)).2,
        OasisFault::Deflate(_) | OasisFault::BlockLength { .. }
    ));
}

/// Many copies cost nothing, and what would cost something is refused.
#[test]
fn bombs() {
    let many = [0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F];
    let on_one_place = [SQUARES, &[1], &many, &many, &[0, 0]].concat();
    let bytes = around(&cell(&on_one_place));
    let mut reader = OasisReader::new(Cursor::new(&bytes), OasisLimits::default()).unwrap();
    reader.read_item().unwrap();
    let OasisItem::Element(element) = reader.read_item().unwrap() else {
        panic!("squares")
    };
    assert_eq!(element.copies, u64::MAX);
    let spread = [SQUARES, &[1], &many, &many, &[1, 1]].concat();
    let limit = |fault| match fault {
        OasisFault::Limit { limit, .. } => limit,
        other => panic!("{other}"),
    };
    assert_eq!(limit(fault_of(&cell(&spread)).1), OasisLimit::Farthest);
    let list = [SQUARES, &[10], &many].concat();
    assert_eq!(limit(fault_of(&cell(&list)).1), OasisLimit::ListPlaces);
    // Pads by the million: 100 bytes a megabyte.
    let pads = vec![0; 1 << 26];
    let mut zeros = block(&pads);
    zeros.extend(block(&pads));
    assert_eq!(limit(fault_of(&zeros).1), OasisLimit::Unpacked);
}

/// An END that is filled by padding the length of an empty padding, as KLayout does.
#[test]
fn an_end_padded_by_an_integer() {
    let mut bytes = around(&cell(SQUARE));
    let begin = bytes.len() - 243;
    bytes.truncate(begin);
    bytes.extend([0x80; 241]);
    bytes.extend([0, 0]);
    assert_eq!(outlines(&bytes).len(), 1);
}

/// The sum of bytes is the other checksum that the format knows.
#[test]
fn a_sum_of_bytes_is_a_checksum_too() {
    let mut bytes = around(&cell(SQUARE));
    let end = bytes.len();
    // Four bytes less of padding, and a scheme with four bytes behind it.
    bytes.truncate(end - 243);
    bytes.extend([0x80 | (0xEC & 0x7F), 1]);
    bytes.extend([0; 236]);
    bytes.push(2);
    let sum: u32 = bytes.iter().map(|&b| u32::from(b)).sum();
    bytes.extend(sum.to_le_bytes());
    assert_eq!(outlines(&bytes).len(), 1);
    bytes[30] ^= 4;
    assert!(matches!(fault(&bytes), (_, None, OasisFault::Checksum { .. })));
}

/// Mutants of this test; `examples/fuzz_oasis.rs` reads as many as its argument says.
const MUTANTS: u64 = 20_000;

#[test]
fn no_damage_makes_the_reader_panic() {
    use rand::SeedableRng;
    let corpus = metalith_testing::oasis::corpus();
    let mut readable = 0;
    for records in &corpus[..3] {
        assert!(metalith_testing::oasis::survives(&around(&block(records))));
    }
    for n in 0..MUTANTS {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        rng.set_stream(n);
        let mutant = metalith_testing::oasis::mutant(&mut rng, &corpus);
        readable += u64::from(metalith_testing::oasis::survives(&mutant));
    }
    // Damage that leaves the file readable is common, and so is damage that does not.
    assert!((MUTANTS / 100..MUTANTS).contains(&readable), "{readable}");
}

/// Compact trapezoids of one side set the modal state of the other: the rectangle behind one, of which nothing is said,
/// has it.
#[test]
fn compact_trapezoids_set_the_implied_side() {
    let cases = [
        (16, 100),
        (17, 100),
        (18, 100),
        (19, 100),
        (25, 100),
        (22, 200),
        (23, 200),
        (20, 200),
        (21, 200),
    ];
    for (form, implied) in cases {
        // A rectangle of 30 x 40, the form with its own side of 100, a rectangle of the modal state.
        let own = if matches!(form, 20 | 21) { 0x20 } else { 0x40 };
        let mut records = vec![14, 1, b'A', 20, 0x63, 1, 0, 30, 40];
        records.extend([26, 0x80 | own, form, 100, 20, 0]);
        let bytes = metalith_testing::oasis::around(&records);
        let mut reader = OasisReader::new(Cursor::new(bytes), OasisLimits::default()).unwrap();
        let mut last = None;
        loop {
            match reader.read_item().unwrap() {
                OasisItem::Element(element) => {
                    if let OasisShape::Rectangle { size } = element.shape {
                        last = Some(size);
                    }
                }
                OasisItem::End => break,
                _ => {}
            }
        }
        let size = if own == 0x20 { [implied, 100] } else { [100, implied] };
        assert_eq!(last, Some(size), "{form}");
    }
}
