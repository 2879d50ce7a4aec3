//! Records that depart from the format in one way and that other programs read: read with a warning, or refused.

use metalith_core::{Progress, Silent};
use metalith_gds::{Error, Layout, LayoutError, ReadLimits, ReadWarning, Selection, Text, Transform, Visitor};
use metalith_testing::gds::Gds;
use metalith_testing::oasis;

use super::{boxes, layout};

/// Reads strictly, and shows nothing.
struct Strict;

impl Progress for Strict {
    fn begin(&self, _: &str, _: u64) {}

    fn advance(&self, _: u64) {}

    fn strict(&self) -> bool {
        true
    }
}

/// Outcome of strict reading.
fn strictly(bytes: &[u8]) -> Option<(u64, LayoutError)> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    match Layout::open_with(file.path(), ReadLimits::default(), &Strict) {
        Ok(_) => None,
        Err(Error::Layout { offset, cause, .. }) => Some((offset, cause)),
        Err(other) => panic!("{other}"),
    }
}

/// The boxes of a layout with one departure, which strict reading refuses at the same place for the same cause.
fn read(bytes: Vec<u8>) -> (ReadWarning, Vec<[i64; 4]>) {
    let layout = layout(bytes.clone());
    let warnings = layout.warnings();
    assert_eq!((warnings.count, warnings.listed.len()), (1, 1), "{warnings:?}");
    let warning = warnings.listed[0].clone();
    let refused = strictly(&bytes).expect("strict reading refuses it");
    assert_eq!(refused, (warning.offset, warning.cause.clone()));
    (warning, boxes(&layout))
}

/// A cell of one square of 10, and a cell at the top with what `draw` draws.
fn with(draw: impl FnOnce(&mut Gds)) -> (u64, Vec<u8>) {
    let mut gds = Gds::library();
    gds.cell("SUB").square(1, 0, 0, 10).end_cell();
    gds.cell("TOP");
    let at = gds.0.len() as u64;
    draw(&mut gds);
    (at, gds.end_cell().end())
}

#[test]
fn arrays_and_references() {
    let (at, bytes) = with(|gds| {
        gds.array("SUB", 0, 3, [5000, 0, 5000, 0, 5000, 300]);
    });
    let (warning, boxes) = read(bytes);
    let cause = LayoutError::ArraySize { columns: 0, rows: 3 };
    assert_eq!((warning.offset, warning.cause), (at, cause));
    let lows: Vec<i64> = boxes.iter().map(|b| b[1]).collect();
    assert_eq!(lows, [-5, 95, 195]);

    // Forty thousand columns stand above 32767.
    let (_, bytes) = with(|gds| {
        gds.array("SUB", 40_000u16 as i16, 1, [0, 0, 800_000, 0, 0, 350]);
    });
    assert_eq!(read(bytes).1.len(), 40_000);

    let (at, bytes) = with(|gds| {
        gds.empty(0x0A).ascii(0x12, "SUB").record(0x1A, 1, &[0, 6]);
        gds.record(0x1C, 5, &metalith_testing::gds::real8(90.0));
        gds.int4(0x10, &[100, 0]).empty(0x11);
    });
    let (warning, boxes) = read(bytes);
    assert_eq!(
        (warning.offset, warning.taken),
        (at + 12, "they were taken as relative")
    );
    assert_eq!(boxes, [[95, -5, 105, 5]]);

    let (_, bytes) = with(|gds| {
        gds.empty(0x0A).ascii(0x12, "SUB").int4(0x10, &[5, 5, 7, 7]).empty(0x11);
    });
    assert_eq!(read(bytes).1, [[0, 0, 10, 10]]);
}

#[test]
fn areas() {
    let form = |kind: u8, points: &[i32]| {
        with(|gds| {
            gds.empty(kind).int2(0x0D, &[2]);
            gds.int2(if kind == 0x2D { 0x2E } else { 0x0E }, &[0]);
            gds.int4(0x10, points).empty(0x11).sref("SUB", 0, 0);
        })
        .1
    };
    let (warning, found) = read(form(0x2D, &[0, 100, 100, 150, 200, 100, 100, 50, 0, 100]));
    assert_eq!(warning.cause, LayoutError::BoxForm { points: 5 });
    assert_eq!(found, [[-5, -5, 5, 5], [0, 50, 200, 150]]);
    let (_, found) = read(form(0x08, &[0, 0, 10, 0]));
    assert_eq!(found, [[-5, -5, 5, 5]]);
    let upright = form(0x2D, &[0, 0, 100, 0, 100, 50, 0, 50, 0, 0]);
    assert_eq!(
        (layout(upright.clone()).warnings().count, strictly(&upright)),
        (0, None)
    );
}

/// Bytes behind the numbers of a record, an element without its end, a name with bytes behind its zero, and elements without
/// points.
#[test]
fn records_that_are_too_long_and_elements_that_do_not_end() {
    let square = |gds: &mut Gds, layer: &[u8], points: &[u8]| {
        gds.empty(0x08).record(0x0D, 2, layer).int2(0x0E, &[0]);
        gds.record(0x10, 3, points);
    };
    let corners: Vec<u8> = [0i32, 0, 8, 0, 8, 8, 0, 8, 0, 0]
        .iter()
        .flat_map(|v| v.to_be_bytes())
        .collect();
    let (at, bytes) = with(|gds| {
        square(gds, &[0, 1], &[&corners[..], &[0; 6]].concat());
        gds.empty(0x11).sref("SUB", 50, 0);
    });
    let (warning, found) = read(bytes);
    assert_eq!(
        (warning.offset, &found[..]),
        (at + 16, &[[0, 0, 8, 8], [45, -5, 55, 5]][..])
    );
    let (_, bytes) = with(|gds| {
        square(gds, &[0, 1], &corners);
        gds.sref("SUB", 50, 0);
    });
    let (warning, found) = read(bytes);
    assert!(matches!(warning.cause, LayoutError::ElementNotEnded { kind: 0x0A, .. }));
    assert_eq!(found, [[0, 0, 8, 8], [45, -5, 55, 5]]);
    let (_, bytes) = with(|gds| {
        gds.empty(0x09)
            .int2(0x0D, &[1])
            .int2(0x0E, &[0])
            .int4(0x10, &[])
            .empty(0x11);
        gds.sref("SUB", 0, 0);
    });
    assert_eq!(read(bytes).1, [[-5, -5, 5, 5]]);
    // Programs in C end a name at its first zero; that is no departure.
    let (_, bytes) = with(|gds| {
        gds.empty(0x0A)
            .record(0x12, 6, b"SUB\0\0\0\0\x01")
            .int4(0x10, &[0, 0])
            .empty(0x11);
    });
    assert_eq!(boxes(&layout(bytes)), [[-5, -5, 5, 5]]);
}

/// Cells that are not in the file are empty for who hears of them, and an error for who is strict or hears nothing.
#[test]
fn missing_cells_are_empty_with_a_warning() {
    struct Hears(std::sync::Mutex<Vec<String>>);
    impl Progress for Hears {
        fn begin(&self, _: &str, _: u64) {}

        fn advance(&self, _: u64) {}

        fn warn(&self, text: &str) {
            self.0.lock().unwrap().push(text.to_owned());
        }
    }
    let (_, bytes) = with(|gds| {
        gds.sref("SUB", 0, 0).sref("ELSEWHERE", 0, 0);
    });
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &bytes).unwrap();
    let hears = Hears(std::sync::Mutex::default());
    let heard = Layout::open_with(file.path(), ReadLimits::default(), &hears).unwrap();
    assert_eq!(boxes(&heard), [[-5, -5, 5, 5]]);
    let warnings = hears.0.into_inner().unwrap();
    assert!(
        warnings.len() == 1 && warnings[0].contains("TOP refers to ELSEWHERE"),
        "{warnings:?}"
    );
    for silent in [
        Layout::open(file.path()),
        Layout::open_with(file.path(), ReadLimits::default(), &Strict),
    ] {
        assert!(silent.unwrap().roots(&Selection::default()).is_err());
    }
}

struct Texts(Vec<(Vec<u8>, i64)>);

impl Visitor for Texts {
    fn shape(&mut self, _: &metalith_gds::Shape<'_>, _: &[Transform]) -> metalith_core::Result<()> {
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, _: &[Transform]) -> metalith_core::Result<()> {
        self.0.push((text.string.to_vec(), text.at.x));
        Ok(())
    }
}

#[test]
fn texts_odd_lengths_and_elements_of_others() {
    let (_, bytes) = with(|gds| {
        gds.empty(0x0C).int2(0x0D, &[1]).int2(0x16, &[0]);
        gds.int4(0x10, &[3, 0, 5, 5])
            .ascii(0x19, "ab")
            .empty(0x11)
            .sref("SUB", 0, 0);
    });
    read(bytes.clone());
    let mut texts = Texts(Vec::new());
    let layout = layout(bytes);
    layout.visit(&Selection::default(), &mut texts, &Silent).unwrap();
    assert_eq!(texts.0, [(b"ab".to_vec(), 3)]);

    let mut odd = Gds::library();
    odd.int2(0x05, &[0; 12]);
    let at = odd.0.len() as u64;
    odd.record(0x06, 6, b"TOP").square(1, 0, 0, 10).end_cell();
    let (warning, found) = read(odd.end());
    let (length, first) = (7, false);
    assert_eq!(
        (warning.offset, warning.cause),
        (at, LayoutError::RecordLength { length, first })
    );
    assert_eq!(found, [[-5, -5, 5, 5]]);

    // A path of the moving stage of a Raith writer.
    let (at, bytes) = with(|gds| {
        gds.empty(0x5A).int2(0x0D, &[2]).int2(0x0E, &[0]).int4(0x0F, &[100]);
        gds.record(0x62, 6, &[0; 64])
            .int4(0x10, &[0, 3000, 2000, 3000])
            .empty(0x11);
        gds.sref("SUB", 0, 0);
    });
    let (warning, found) = read(bytes);
    assert_eq!(
        (warning.offset, warning.cause),
        (at, LayoutError::PrivateElement { kind: 0x5A })
    );
    assert_eq!(found, [[-5, -5, 5, 5]]);
}

/// Many departures are counted, and the first are listed.
#[test]
fn the_list_is_capped() {
    let (_, bytes) = with(|gds| {
        for _ in 0..1000 {
            gds.array("SUB", 0, 1, [0; 6]);
        }
    });
    let layout = layout(bytes);
    assert_eq!((layout.warnings().count, layout.warnings().listed.len()), (1000, 8));
}

#[test]
fn departures_of_oasis() {
    let cell = |records: &[u8]| [&[14, 3], b"TOP".as_slice(), records].concat();
    // A list of level and upright steps that ends on the corner that it implies.
    let odd = [21, 0x3B, 2, 0, 0, 5, 200, 1, 144, 3, 100, 216, 4, 173, 2, 0, 144, 78];
    let (warning, found) = read(oasis::around(&cell(&odd)));
    assert_eq!(warning.taken, "the points were taken as they are");
    assert_eq!(found, [[0, 5000, 150, 5500]]);
    let mut trailing = oasis::around(&cell(&[20, 0xDB, 1, 0, 10, 0, 0]));
    trailing.push(b'\n');
    let (warning, found) = read(trailing);
    assert_eq!(warning.taken, "the bytes behind it were not read");
    assert_eq!(found, [[0, 0, 10, 10]]);
    // A path of no length whose ends reach out by half its width of 100.
    let path = [22, 0xFB, 2, 0, 50, 0b1010, 4, 1, 1, 0, 0, 0];
    assert_eq!(boxes(&layout(oasis::around(&cell(&path)))), [[-50, -50, 50, 50]]);
}

/// The cell in which KLayout keeps notes refers to every cell: it is no layout.
#[test]
fn notes_are_no_layout() {
    let mut gds = Gds::library();
    gds.cell("$$$CONTEXT_INFO$$$").polygon(0, &[(0, 0); 5]);
    gds.sref("SUB", 0, 0).sref("TOP", 0, 0).end_cell();
    gds.cell("SUB").square(1, 0, 0, 10).end_cell();
    gds.cell("TOP").sref("SUB", 100, 0).end_cell();
    let layout = layout(gds.end());
    assert_eq!((layout.cells().len(), layout.tops().len()), (2, 1));
    assert!(layout.has_notes());
    assert_eq!(boxes(&layout), [[95, -5, 105, 5]]);
}

/// A layout below one of its cells has no others.
#[test]
fn one_top_of_several_is_chosen() {
    let mut gds = Gds::library();
    gds.cell("SUB").square(1, 0, 0, 10).end_cell();
    gds.cell("A").sref("SUB", 0, 0).end_cell();
    gds.cell("B").sref("SUB", 50, 0).sref("SUB", 90, 0).end_cell();
    let bytes = gds.end();
    let below = layout(bytes.clone()).below("B").unwrap();
    let names: Vec<&str> = below.cells().iter().map(|c| c.name.as_str()).collect();
    assert_eq!((names, below.tops().len()), (vec!["SUB", "B"], 1));
    assert_eq!(boxes(&below).len(), 2);
    let id = |error: metalith_gds::Error| metalith_core::Error::from(error).id();
    let whole = layout(bytes.clone());
    let visited = whole.visit(&Selection::default(), &mut super::Flat(Vec::new()), &Silent);
    // The file is sound: what was asked of it is not.
    assert_eq!(id(visited.unwrap_err()), "layout/several-tops");
    assert_eq!(
        id(layout(bytes).below("C").map(|_| ()).unwrap_err()),
        "layout/no-such-cell"
    );
}

/// A file that gzip made is unpacked; one cut short, or that unpacks to far more than layouts do, is refused. DXF is named.
#[test]
fn compressed_files_are_read() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lens.gds.gz");
    let pack = |bytes: &[u8]| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    };
    let open = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        Layout::open(&path)
    };
    let (_, bytes) = with(|gds| {
        gds.sref("SUB", 7, 0);
    });
    let packed = pack(&bytes);
    let layout = open(&packed).unwrap();
    assert_eq!(layout.path(), path);
    assert_eq!(boxes(&layout), [[2, -5, 12, 5]]);
    let cause = |result: Result<Layout, Error>| match result {
        Err(Error::Layout { cause, .. }) => cause,
        other => panic!("{:?}", other.map(|_| ())),
    };
    assert!(matches!(cause(open(&packed[..packed.len() / 2])), LayoutError::Gzip(_)));
    let bomb = pack(&vec![0; 80 << 20]);
    assert!(matches!(cause(open(&bomb)), LayoutError::Unpacked { .. }));
    let binary = open(b"AutoCAD Binary DXF\r\n\x1a\0");
    assert!(matches!(cause(binary), LayoutError::OtherFormat { .. }));
    for design in [
        &b"# A lens.\n\n[array]\nrows = 3\n"[..],
        b"schema = 1\nname = \"lens\"\n",
    ] {
        assert!(matches!(cause(open(design)), LayoutError::OtherFormat { .. }));
    }
}
