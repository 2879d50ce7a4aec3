//! Round trips: each record that is written is read back equal.

use std::io::Cursor;

use metalith_oasis::*;
use proptest::prelude::*;

/// An element as a test holds it: all copies where they stand.
#[derive(Clone, Debug, PartialEq)]
enum Drawn {
    Rectangle([u32; 2], [i64; 2], [i64; 2]),
    Polygon([u32; 2], Vec<[i64; 2]>),
    Path([u32; 2], i64, [i64; 2], Vec<[i64; 2]>),
    Circle([u32; 2], [i64; 2], i64),
    Text([u32; 2], u64, [i64; 2]),
    Placement(u64, [i64; 2], bool, f64, f64),
}

impl Drawn {
    fn write(&self, out: &mut RecordBuffer, repetition: Option<&Repetition>) {
        match self {
            Self::Rectangle(layer, at, size) => out.rectangle(*layer, *at, *size, repetition),
            Self::Polygon(layer, corners) => out.polygon(*layer, corners, repetition),
            Self::Path(layer, half, ends, line) => out.path(*layer, *half, *ends, line, repetition),
            Self::Circle(layer, at, radius) => out.circle(*layer, *at, *radius, repetition),
            Self::Text(layer, text, at) => out.text(*layer, *text, *at, repetition),
            Self::Placement(cell, at, mirrored, magnification, angle_deg) => {
                let placing = Placing {
                    mirrored: *mirrored,
                    magnification: *magnification,
                    angle_deg: *angle_deg,
                };
                out.placement(*cell, *at, &placing, repetition);
            }
        }
    }

    fn of(element: &OasisElement<'_>) -> Self {
        let (layer, at) = ([element.layer, element.datatype], element.at);
        let from = |points: &[[i64; 2]]| points.iter().map(|p| [p[0] + at[0], p[1] + at[1]]).collect();
        let number = |reference| match reference {
            CellReference::Number(number) => number,
            CellReference::Name(name) => panic!("strict files refer by number, not by {name:?}"),
        };
        match element.shape {
            OasisShape::Rectangle { size } => Self::Rectangle(layer, at, size),
            OasisShape::Polygon { points } => Self::Polygon(layer, from(points)),
            OasisShape::Path {
                points,
                half_width,
                extensions,
            } => Self::Path(layer, half_width, extensions, from(points)),
            OasisShape::Circle { radius } => Self::Circle(layer, at, radius),
            OasisShape::Text { string } => Self::Text(layer, number(string), at),
            OasisShape::Placement {
                cell,
                mirrored,
                magnification,
                angle_deg,
            } => Self::Placement(number(cell), at, mirrored, magnification, angle_deg),
            OasisShape::Private { .. } => panic!("nothing private was written"),
        }
    }
}

type Copies = Option<Vec<[i64; 2]>>;

fn places(repetition: Option<&Repetition>) -> Copies {
    repetition.filter(|r| r.copies() > 1).map(|r| {
        let mut places = Vec::new();
        r.each(|p| {
            places.push(p);
            Ok::<_, ()>(())
        })
        .unwrap();
        places
    })
}

fn written(elements: &[(Drawn, Option<Repetition>)], relative: bool, level: u32) -> Vec<u8> {
    let mut writer = OasisWriter::new(Vec::new(), 1000.0, &["TOP"], true).unwrap();
    let (top, _) = (writer.cell_number("TOP"), writer.cell_number("OTHER"));
    for text in ["a", "b c", ""] {
        writer.text_number(text);
    }
    writer.begin_cell(top).unwrap();
    // Two buffers: the second relies on nothing of the first.
    for half in elements.chunks(elements.len().div_ceil(2).max(1)) {
        let mut records = if relative {
            RecordBuffer::relative()
        } else {
            RecordBuffer::absolute()
        };
        half.iter()
            .for_each(|(drawn, repetition)| drawn.write(&mut records, repetition.as_ref()));
        writer.block(&CompressedBlock::of(records.bytes(), level)).unwrap();
    }
    writer.end_cell(CellBounds::Empty);
    writer.finish().unwrap().0
}

fn read(bytes: &[u8]) -> Vec<(Drawn, Copies)> {
    let mut reader = OasisReader::new(Cursor::new(bytes), OasisLimits::default()).unwrap();
    let mut found = Vec::new();
    loop {
        match reader.read_item().unwrap() {
            OasisItem::Element(element) => found.push((Drawn::of(&element), places(element.repetition))),
            OasisItem::End => return found,
            _ => {}
        }
    }
}

fn point() -> impl Strategy<Value = [i64; 2]> {
    let axis = || prop_oneof![Just(0), -3i64..4, -1_000_000i64..1_000_000];
    (axis(), axis()).prop_map(|(x, y)| [x, y])
}

fn drawn() -> impl Strategy<Value = Drawn> {
    let layer = || (0u32..3, 0u32..300).prop_map(|(l, d)| [l, d]);
    let manhattan = |steps: Vec<(i64, i64)>| {
        let mut at = [0, 0];
        let mut corners = vec![at];
        for (x, y) in steps {
            at[0] += x;
            corners.push(at);
            at[1] += y;
            corners.push(at);
        }
        // Back to the left, so that the last edge is upright.
        corners.push([0, at[1]]);
        corners
    };
    prop_oneof![
        (layer(), point(), 0i64..300, 0i64..300).prop_map(|(l, at, w, h)| Drawn::Rectangle(l, at, [w, h])),
        (layer(), point(), 0i64..300).prop_map(|(l, at, w)| Drawn::Rectangle(l, at, [w, w])),
        (layer(), prop::collection::vec(point(), 3..9)).prop_map(|(l, p)| Drawn::Polygon(l, p)),
        (layer(), prop::collection::vec((-50i64..50, -50i64..50), 1..5))
            .prop_map(move |(l, s)| Drawn::Polygon(l, manhattan(s))),
        (
            layer(),
            0i64..90,
            -9i64..99,
            -9i64..99,
            prop::collection::vec(point(), 2..6)
        )
            .prop_map(|(l, h, a, b, p)| Drawn::Path(l, h, [a, b], p)),
        (layer(), point(), 0i64..90).prop_map(|(l, at, r)| Drawn::Circle(l, at, r)),
        (layer(), 0u64..3, point()).prop_map(|(l, t, at)| Drawn::Text(l, t, at)),
        (0u64..2, point(), any::<bool>(), 0u8..4).prop_map(|(c, at, m, q)| Drawn::Placement(
            c,
            at,
            m,
            1.0,
            90.0 * f64::from(q)
        )),
        (0u64..2, point(), any::<bool>(), 0.1f64..9.0, 0.0f64..360.0)
            .prop_map(|(c, at, m, mag, angle)| Drawn::Placement(c, at, m, mag, angle)),
    ]
}

fn repetition() -> impl Strategy<Value = Option<Repetition>> {
    let grid = (2u64..5, 1u64..4, point(), point()).prop_map(|(n, m, a, b)| Repetition::Grid {
        count: [n, m],
        step: [a, if m > 1 { b } else { [0, 0] }],
    });
    let place = prop_oneof![
        (0i32..9).prop_map(|x| [x, 0]),
        (0i32..9).prop_map(|y| [0, y]),
        (-99i32..99, -99i32..99).prop_map(|(x, y)| [x, y])
    ];
    let list = (prop_oneof![Just(1i64), 2i64..400], prop::collection::vec(place, 1..9))
        .prop_map(|(grid, places)| Repetition::List { grid, places });
    prop_oneof![3 => Just(None), 1 => grid.prop_map(Some), 2 => list.prop_map(Some)]
}

proptest! {
    #[test]
    fn what_is_written_is_read(
        elements in prop::collection::vec((drawn(), repetition()), 1..40), relative: bool, level in 1u32..10,
    ) {
        let expected: Vec<_> = elements.iter().map(|(d, r)| (d.clone(), places(r.as_ref()))).collect();
        prop_assert_eq!(read(&written(&elements, relative, level)), expected);
    }
}

/// A file is 256 bytes of END behind everything else, and its offsets lead to the cells.
#[test]
fn offsets_lead_to_cells_and_end_is_256_bytes() {
    let square = Drawn::Rectangle([1, 0], [0, 0], [9, 9]);
    let bytes = written(&[(square, None)], true, 6);
    assert_eq!(bytes[bytes.len() - 256], 2);
    let mut reader = OasisReader::new(Cursor::new(&bytes), OasisLimits::default()).unwrap();
    let (mut begun, mut offsets, mut named) = (Vec::new(), Vec::new(), Vec::new());
    loop {
        let place = match reader.read_item().unwrap() {
            OasisItem::End => break,
            OasisItem::Name(entry) => {
                named.push((entry.table, String::from_utf8(entry.name.to_vec()).unwrap()));
                continue;
            }
            OasisItem::Property { values, standard, .. } => {
                assert!(standard);
                offsets.extend(values.iter().cloned());
                continue;
            }
            OasisItem::Cell(_) => true,
            OasisItem::Element(_) => false,
        };
        if place {
            begun.push(reader.place().offset);
        }
    }
    assert!(offsets.contains(&OasisValue::Unsigned(begun[0])));
    assert!(named.contains(&(NameTable::PropertyTexts, "TOP".into())));
    assert!(named.contains(&(NameTable::Properties, "S_CELL_OFFSET".into())));
}

/// A cell that was met is read again from its place, in and out of CBLOCKs.
#[test]
fn cells_are_found_again() {
    let mut writer = OasisWriter::new(Vec::new(), 1000.0, &["A", "B"], true).unwrap();
    for (k, name) in ["A", "B"].into_iter().enumerate() {
        let number = writer.cell_number(name);
        let mut records = RecordBuffer::relative();
        for i in 0..1000 {
            records.rectangle([1, 0], [i * 350, k as i64], [100 + i % 7, 50], None);
        }
        writer.begin_cell(number).unwrap();
        writer.block(&CompressedBlock::of(records.bytes(), 6)).unwrap();
        writer.end_cell(CellBounds::Empty);
    }
    let bytes = writer.finish().unwrap().0;
    let mut reader = OasisReader::new(Cursor::new(&bytes), OasisLimits::default()).unwrap();
    let mut cells = Vec::new();
    loop {
        let is_cell = match reader.read_item().unwrap() {
            OasisItem::Cell(_) => true,
            OasisItem::End => break,
            _ => false,
        };
        if is_cell {
            cells.push(reader.place());
        }
    }
    for (k, place) in cells.iter().enumerate().rev() {
        reader.seek(*place).unwrap();
        assert!(matches!(reader.read_item().unwrap(), OasisItem::Cell(CellReference::Number(n)) if n == k as u64));
        let OasisItem::Element(first) = reader.read_item().unwrap() else {
            panic!("a square")
        };
        assert_eq!(first.at, [0, k as i64]);
    }
}
