//! Tests of the same reader on OASIS: files of records, of other tools, hostile and damaged ones.

use metalith_core::Silent;
use metalith_gds::{FileFormat, LayoutError, Limit, Selection, simplified};
use metalith_oasis::{CellBounds, CompressedBlock, OasisFault, OasisWriter, Placing, RecordBuffer, Repetition};
use metalith_testing::{mutate, oasis};
use rand::SeedableRng;

use super::{Error, Flat, Layout, Point, ReadLimits, boxes, layout};

/// Trapezoids of all kinds and point lists of all types are what KLayout reads.
#[test]
fn forms_are_those_that_klayout_reads() {
    let folder = metalith_testing::root().join("golden/foreign");
    let outlines = |name: &str| {
        let layout = Layout::open(&folder.join(name)).unwrap();
        let mut flat = Flat(Vec::new());
        layout.visit(&Selection::default(), &mut flat, &Silent).unwrap();
        let corners = |(_, points): &(_, Vec<Point>)| {
            let mut corners = simplified(points);
            corners.sort_unstable();
            corners.dedup();
            corners
        };
        let mut all: Vec<Vec<Point>> = flat.0.iter().map(corners).collect();
        all.sort_unstable();
        (layout.format(), all)
    };
    let (ours, theirs) = (outlines("forms.oas"), outlines("forms.gds"));
    assert_eq!((ours.0, theirs.0), (FileFormat::Oasis, FileFormat::Gds));
    assert_eq!(ours.1.len(), 62);
    assert_eq!(ours.1, theirs.1);
}

/// A file of cells: what is in each, and the first is at the top.
fn file(cells: &[(&str, &[u8])], in_one_block: bool) -> Vec<u8> {
    let mut records = Vec::new();
    for (name, bytes) in cells {
        records.extend([14, name.len() as u8]);
        records.extend(name.bytes());
        records.extend_from_slice(bytes);
    }
    if in_one_block {
        oasis::around(&oasis::block(&records))
    } else {
        oasis::around(&records)
    }
}

/// A reference by name.
fn placed(name: &str, repetition: &[u8]) -> Vec<u8> {
    let bits = 0xB0 | if repetition.is_empty() { 0 } else { 8 };
    [&[17, bits, name.len() as u8], name.as_bytes(), &[0, 0], repetition].concat()
}

const SQUARE: &[u8] = &[20, 0xDB, 1, 0, 10, 0, 0];
const SQUARES: &[u8] = &[20, 0xDF, 1, 0, 10, 0, 0];
/// 2^62 columns and as many rows on one place.
const MANY: &[u8] = &[
    1, 0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x3F, 0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x3F, 0, 0,
];

fn refused(bytes: Vec<u8>) -> LayoutError {
    let layout = layout(bytes);
    match layout.visit(&Selection::default(), &mut Flat(Vec::new()), &Silent) {
        Err(Error::Layout { cause, .. }) => cause,
        other => panic!("{other:?}"),
    }
}

#[test]
fn more_copies_than_atoms_are_counted_and_refused() {
    let squares = [SQUARES, MANY].concat();
    let limit = |cause| match cause {
        LayoutError::Limit { limit, .. } => limit,
        other => panic!("{other}"),
    };
    assert_eq!(limit(refused(file(&[("A", &squares)], false))), Limit::FlatShapes);
    let cells = placed("B", MANY);
    assert_eq!(
        limit(refused(file(&[("A", &cells), ("B", SQUARE)], true))),
        Limit::FlatShapes
    );
    let texts = [&[19, 0x5F, 1, b'x', 1, 0, 0, 0], MANY].concat();
    assert_eq!(limit(refused(file(&[("A", &texts)], false))), Limit::FlatTexts);
    let names: Vec<String> = (0..400).map(|k| format!("C{k}")).collect();
    let chain: Vec<Vec<u8>> = (1..=400).map(|k| placed(&format!("C{k}"), &[])).collect();
    let mut cells: Vec<(&str, &[u8])> = names
        .iter()
        .map(String::as_str)
        .zip(chain.iter().map(Vec::as_slice))
        .collect();
    cells.push(("C400", SQUARE));
    assert_eq!(limit(refused(file(&cells, true))), Limit::Depth);
}

/// Thousands of cells in one CBLOCK, each with a copy of a large one: none is unpacked more than once a pass.
#[test]
fn many_cells_in_one_block_are_read_in_order() {
    const CELLS: usize = 3000;
    let names: Vec<String> = (0..CELLS).map(|k| format!("C{k}")).collect();
    let top: Vec<u8> = names.iter().flat_map(|name| placed(name, &[])).collect();
    let large: Vec<u8> = SQUARE.repeat(100);
    // Much that is skipped between them: going back to the start for each cell would unpack 30 GB.
    let body = [placed("LARGE", &[]), vec![0; 3000]].concat();
    let mut cells: Vec<(&str, &[u8])> = vec![("TOP", &top)];
    cells.extend(names.iter().rev().map(|name| (name.as_str(), body.as_slice())));
    cells.push(("LARGE", &large));
    let layout = layout(file(&cells, true));
    assert_eq!(boxes(&layout).len(), CELLS * 100);
}

/// A cell by its number and by its name is one cell, wherever the table stands.
#[test]
fn numbers_and_names_are_one() {
    let table: &[u8] = b"\x04\x01B\x07\x04\x03TOP\x02";
    let cells = [&[13, 2][..], &[17, 0xF0, 7, 20, 0], &placed("B", &[]), &[13, 7], SQUARE].concat();
    for records in [[table, &cells].concat(), [&cells[..], table].concat()] {
        let layout = layout(oasis::around(&oasis::block(&records)));
        let names: Vec<&str> = layout.cells().iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["TOP", "B"]);
        assert!(layout.dangling().is_empty() && layout.doubled().is_empty());
        assert_eq!(boxes(&layout), [[0, 0, 10, 10], [10, 0, 20, 10]]);
        assert_eq!(layout.cell_index("B"), Some(1));
    }
    let dangling = layout(oasis::around(&[&[13, 2][..], &[17, 0xF0, 9, 0, 0], table].concat()));
    assert_eq!(dangling.dangling()[0].name, "#9");
}

/// 2^56 is one more than a key of eight bytes can tell.
#[test]
fn numbers_beyond_the_largest_are_no_other_cell() {
    let number = [0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x01];
    let records = [&[13][..], &number, SQUARE].concat();
    let read = Layout::from_bytes("test.oas", oasis::around(&records), ReadLimits::default());
    let error = read.map(|_| ()).unwrap_err();
    let number = 1 << 56;
    assert_eq!(error.in_layout().unwrap().1, &LayoutError::CellNumber { number });
}

/// Copies of squares, texts, polygons and cells stand where the lists say.
#[test]
fn copies_stand_where_they_are_said_to() {
    let mut writer = OasisWriter::new(Vec::new(), 1000.0, &["TOP"], true).unwrap();
    let (top, cell) = (writer.cell_number("TOP"), writer.cell_number("CELL"));
    let list = Repetition::List {
        grid: 100,
        places: vec![[3, 0], [-2, 5]],
    };
    let mut records = RecordBuffer::relative();
    records.rectangle([1, 0], [0, 0], [10, 20], Some(&list));
    records.polygon([1, 0], &[[0, 0], [9, 0], [0, 9]], Some(&list));
    writer.begin_cell(cell).unwrap();
    writer.block(&CompressedBlock::of(records.bytes(), 6)).unwrap();
    writer.end_cell(CellBounds::Empty);
    records.clear();
    let mirrored = Placing {
        mirrored: true,
        ..Placing::PLAIN
    };
    records.placement(cell, [1000, 1000], &mirrored, Some(&list));
    writer.begin_cell(top).unwrap();
    writer.block(&CompressedBlock::of(records.bytes(), 6)).unwrap();
    writer.end_cell(CellBounds::Empty);
    let layout = layout(writer.finish().unwrap().0);
    let places = [[0, 0], [300, 0], [-200, 500]];
    let mut expected = Vec::new();
    for [x, y] in places {
        for [dx, dy] in places {
            let (left, high) = (1000 + x + dx, 1000 + y - dy);
            expected.extend([[left, high - 20, left + 10, high], [left, high - 9, left + 9, high]]);
        }
    }
    expected.sort_unstable();
    assert_eq!(boxes(&layout), expected);
    assert_eq!(layout.flat_shapes(), 18);
}

#[test]
fn faults_have_places_and_remedies() {
    let bytes = file(&[("A", &[SQUARE, &[99]].concat())], true);
    let fault = |bytes: &[u8]| match Layout::from_bytes("test.oas", bytes, ReadLimits::default()).map(|_| ()) {
        Err(Error::Layout { offset, cause, .. }) => (offset, cause),
        other => panic!("{other:?}"),
    };
    let (offset, cause) = fault(&bytes);
    let unknown = LayoutError::Oasis {
        inner: Some(10),
        fault: OasisFault::RecordKind(99),
    };
    assert_eq!((offset, &cause), (22, &unknown));
    insta::assert_snapshot!(format!("{cause}\n  help: {}", cause.remedy()), @"
        byte 10 of the CBLOCK there: record type 99 is not OASIS
          help: the file is damaged: write or copy it again
        ");
    let whole = file(&[("A", SQUARE)], false);
    let cut = fault(&whole[..28]).1;
    let ends_early = LayoutError::Oasis {
        inner: None,
        fault: OasisFault::EndsEarly,
    };
    assert_eq!(cut, ends_early);
}

/// Five thousand damaged files through everything that reads; `examples/fuzz_reader.rs` makes as many as you like.
#[test]
fn damaged_records_never_panic() {
    let corpus = oasis::corpus();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(20_261_122);
    for _ in 0..5000 {
        mutate::survives(&oasis::mutant(&mut rng, &corpus));
    }
}
