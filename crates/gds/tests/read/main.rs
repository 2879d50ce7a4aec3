//! The reader and the extraction: hand-built bytes, files of other tools, random trees, damaged bytes.

mod departures;
mod drawn;
mod dxf;
mod folded;
mod oasis;
mod pillar_layer;
mod pillars;
mod trees;

use std::path::PathBuf;

use metalith_core::Silent;
use metalith_gds::{
    Error, LayerNumber, Layout, LayoutError, Limit, Point, ReadLimits, Rect, Selection, Shape, Transform, Visitor,
};
use metalith_testing::gds::{self, Gds};
use rand::SeedableRng;

const PILLARS: LayerNumber = LayerNumber { layer: 1, datatype: 0 };

fn layout(bytes: Vec<u8>) -> Layout {
    Layout::from_bytes("test.gds", bytes, ReadLimits::default()).unwrap()
}

fn fault_of(bytes: Vec<u8>) -> (u64, LayoutError) {
    match Layout::from_bytes("test.gds", bytes, ReadLimits::default()).map(|_| ()) {
        Err(Error::Layout { offset, cause, .. }) => (offset, cause),
        other => panic!("expected a fault of the layout, not {other:?}"),
    }
}

/// All areas of a layout, flat: bounding boxes and outlines where they stand.
struct Flat(Vec<(LayerNumber, Vec<Point>)>);

impl Visitor for Flat {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        for t in placements {
            self.0.push((shape.layer, shape.outline.placed(t)));
            if let (Some(rect), true) = (shape.rect, t.is_square()) {
                let placed = t.apply_rect(&rect).unwrap();
                assert_eq!(placed, around(&self.0.last().unwrap().1));
            }
        }
        Ok(())
    }
}

fn around(points: &[Point]) -> Rect {
    Rect {
        x0: points.iter().map(|p| p.x).min().unwrap(),
        y0: points.iter().map(|p| p.y).min().unwrap(),
        x1: points.iter().map(|p| p.x).max().unwrap(),
        y1: points.iter().map(|p| p.y).max().unwrap(),
    }
}

fn boxes(layout: &Layout) -> Vec<[i64; 4]> {
    let mut flat = Flat(Vec::new());
    layout.visit(&Selection::default(), &mut flat, &Silent).unwrap();
    let mut boxes: Vec<_> = flat
        .0
        .iter()
        .map(|(_, p)| around(p))
        .map(|r| [r.x0, r.y0, r.x1, r.y1])
        .collect();
    boxes.sort_unstable();
    boxes
}

/// Layouts of the lens by other tools: 11 in each format.
fn foreign_files() -> Vec<PathBuf> {
    let folder = metalith_testing::root().join("golden/foreign");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "gds" || e == "oas"))
        .filter(|p| p.file_stem().is_some_and(|s| s != "forms"))
        .collect();
    files.sort();
    assert_eq!(files.len(), 22);
    files
}

/// Nobody knows how wide a path of absolute width is where its cell is magnified.
#[test]
fn absolute_widths_and_magnified_cells_do_not_go_together() {
    let drawn = |width: i32, magnification: f64| {
        let mut gds = Gds::library();
        gds.cell("TOP")
            .placed("LINE", 0, 0, false, magnification, 90.0)
            .end_cell();
        gds.cell("LINE").empty(0x09).int2(0x0D, &[1]).int2(0x0E, &[0]);
        gds.int4(0x0F, &[width])
            .int4(0x10, &[0, 0, 1000, 0])
            .empty(0x11)
            .end_cell();
        gds.end()
    };
    assert_eq!(boxes(&layout(drawn(-200, 1.0))), [[-100, 0, 100, 1000]]);
    assert_eq!(boxes(&layout(drawn(200, 2.0))), [[-200, 0, 200, 2000]]);
    // Other programs magnify it all the same.
    let both = layout(drawn(-200, 2.0));
    assert_eq!(both.warnings().listed[0].cause, LayoutError::AbsoluteWidth);
    assert_eq!(boxes(&both), [[-200, 0, 200, 2000]]);
}

/// Optional records, unusual order, several XY records, padding: all legal, all read.
#[test]
fn legal_variations_are_read() {
    let mut bytes = gds::everything();
    bytes.resize(bytes.len() + 2048, 0);
    let layout = layout(bytes);
    assert_eq!(layout.trailing(), (2048, false));
    assert_eq!(layout.unit_nm(), 1.0);
    assert_eq!(layout.depth(), 2);
    assert_eq!(layout.flat_shapes(), 100 * 4 + 2 + 20 + 4);
    assert_eq!(boxes(&layout).len(), 426);
    let odd = &layout.cells()[layout.cell_index("ODD").unwrap()];
    assert_eq!((odd.with_properties, odd.texts()), (1, 1));
}

#[test]
fn faults_name_the_byte() {
    let whole = gds::everything();
    // Cut anywhere, a file is a fault near its end, and never a shorter layout.
    for cut in (0..whole.len() - 4).step_by(7) {
        let (offset, cause) = fault_of(whole[..cut].to_vec());
        assert!(offset <= cut as u64, "{cause}");
    }
    let head = Gds::library().0.len() as u64;
    let mut short = Gds::library();
    short.cell("A").0.extend([0, 2, 0x08, 0]);
    let length = LayoutError::RecordLength {
        length: 2,
        first: false,
    };
    assert_eq!(fault_of(short.end()), (head + 28 + 6, length));
    let mut unknown = Gds::library();
    unknown.record(0x77, 0, &[]);
    assert_eq!(fault_of(unknown.end()).0, head);
    let mut unended = Gds::library();
    unended.cell("A").empty(0x08).int2(0x0D, &[1]).end_cell();
    let cause = fault_of(unended.end()).1;
    assert!(matches!(cause, LayoutError::ElementNotEnded { .. }), "{cause:?}");
    let mut bare = Gds::library();
    bare.cell("A")
        .empty(0x08)
        .int4(0x10, &[0, 0, 1, 0, 1, 1, 0, 0])
        .empty(0x11);
    let no_layer = LayoutError::Lacks {
        element: "BOUNDARY",
        lacks: "LAYER",
    };
    assert_eq!(fault_of(bare.end_cell().end()).1, no_layer);
    assert_eq!(fault_of(b"%PDF-1.4 not a layout".to_vec()).1, LayoutError::NoHeader);
}

#[test]
fn faults_of_the_tree_are_found_before_anything_is_expanded() {
    let visit = |bytes: Vec<u8>| visited(&layout(bytes)).unwrap_err();
    let text = str::to_owned;
    let mut dangling = Gds::library();
    dangling.cell("A").sref("NOWHERE", 0, 0).end_cell();
    let (cell, name) = (text("A"), text("NOWHERE"));
    assert_eq!(visit(dangling.end()), LayoutError::Dangling { cell, name });
    let mut circle = Gds::library();
    circle.cell("A").sref("B", 0, 0).end_cell();
    circle.cell("B").sref("C", 0, 0).end_cell();
    circle.cell("C").sref("B", 0, 0).square(1, 0, 0, 10).end_cell();
    let (cell, name) = (text("C"), text("B"));
    assert_eq!(visit(circle.end()), LayoutError::Circle { cell, name });
    // Forty levels of two references each: 10^12 squares from a few kilobytes.
    let mut bomb = Gds::library();
    bomb.cell("L0").square(1, 0, 0, 10).end_cell();
    for k in 1..=40 {
        let below = format!("L{}", k - 1);
        bomb.cell(&format!("L{k}"))
            .sref(&below, 0, 0)
            .sref(&below, 10, 0)
            .end_cell();
    }
    let layout = layout(bomb.end());
    assert_eq!(layout.flat_shapes(), 1 << 40);
    let cause = visited(&layout).unwrap_err();
    let (limit, most) = (Limit::FlatShapes, ReadLimits::default().flat_shapes);
    assert_eq!(
        cause,
        LayoutError::Limit {
            limit,
            found: 1 << 40,
            most
        }
    );
}

fn visited(layout: &Layout) -> Result<(), LayoutError> {
    match layout.visit(&Selection::default(), &mut Flat(Vec::new()), &Silent) {
        Err(Error::Layout { cause, .. }) => Err(cause),
        other => {
            other.unwrap();
            Ok(())
        }
    }
}

/// A text of 60 kB under an array of 320 x 320 copies: 6 GB for whoever keeps texts.
#[test]
fn texts_count_as_often_as_they_stand() {
    let mut bomb = Gds::library();
    bomb.cell("T");
    bomb.text(10, &"x".repeat(60_000), 0, 0).end_cell();
    bomb.cell("TOP").array("T", 320, 320, [0, 0, 320, 0, 0, 320]).end_cell();
    let found = 320 * 320 * (60_000 + 64);
    let layout_of_bomb = layout(bomb.end());
    let limits = ReadLimits::default();
    let most = limits.flat_text_bytes + limits.flat_text_bytes_per_byte * layout_of_bomb.bytes();
    let limit = Limit::FlatTexts;
    assert_eq!(visited(&layout_of_bomb), Err(LayoutError::Limit { limit, found, most }));
    // Labels that stand in the file one by one are no matter, however many they are.
    let of_file = 2_000_000;
    assert!(of_file * 36 * limits.flat_text_bytes_per_byte > of_file * (64 + 8));
    // As many short labels as a mask may have are no matter.
    let mut labels = Gds::library();
    labels.cell("T").text(10, "0123456789", 0, 0).end_cell();
    labels
        .cell("TOP")
        .array("T", 320, 320, [0, 0, 320, 0, 0, 320])
        .end_cell();
    assert_eq!(visited(&layout(labels.end())), Ok(()));
}

/// A few hundred bytes that ask for 2e9 squares are refused for their size, before one is made.
#[test]
fn a_short_file_has_no_billion_of_shapes() {
    let mut bomb = Gds::library();
    bomb.cell("P").square(1, 0, 0, 100).end_cell();
    bomb.cell("TOP")
        .array("P", 32_000, 32_000, [0, 0, 350 * 32_000, 0, 0, 350 * 32_000])
        .end_cell();
    let layout = layout(bomb.end());
    let (found, limits) = (32_000 * 32_000, ReadLimits::default());
    let most = limits.short_file_shapes + limits.shapes_per_byte * layout.bytes();
    let limit = Limit::FlatShapesOfShortFile;
    assert!(found < limits.flat_shapes);
    assert_eq!(visited(&layout), Err(LayoutError::Limit { limit, found, most }));
}

/// Names come out printable, unlike names look unlike, and a cell is found by what is printed.
#[test]
fn names_are_printable() {
    let mut gds = Gds::library();
    gds.cell("A\u{1b}[2J\u{fffe}").square(1, 0, 0, 10).end_cell();
    gds.cell("TOP")
        .sref("A\u{1b}[2J\u{fffe}", 0, 0)
        .sref("B\n", 0, 0)
        .end_cell();
    let layout = layout(gds.end());
    assert_eq!(layout.cells()[0].name, "A\\u{1b}[2J\\u{fffe}");
    assert_eq!(layout.cell_index("A\\u{1b}[2J\\u{fffe}"), Some(0));
    assert_eq!(layout.cell_index("A\u{1b}[2J\u{fffe}"), Some(0));
    let error = visited(&layout).unwrap_err();
    insta::assert_snapshot!(error, @r"cell TOP refers to B\u{a}, which is not in the file");
}

/// The program's error says the same as ours, and keeps it as its source.
#[test]
fn causes_stay_behind_the_text() {
    use std::error::Error as _;
    let bytes = &gds::everything()[..500];
    let error = Layout::from_bytes("cut.gds", bytes, ReadLimits::default())
        .map(|_| ())
        .unwrap_err();
    let text = format!("{error}\n  help: {}", error.in_layout().unwrap().1.remedy());
    let of_program = metalith_core::Error::from(error);
    assert_eq!(of_program.to_string(), text);
    let behind = of_program.source().and_then(|s| s.downcast_ref::<Error>());
    assert!(
        matches!(
            behind,
            Some(Error::Layout {
                cause: LayoutError::EndsInRecord { .. },
                ..
            })
        ),
        "{behind:?}"
    );
}

/// Cells with dangling and circular references can still be visited by whoever reports these faults.
#[test]
fn a_lenient_visit_goes_round_faults() {
    let mut gds = Gds::library();
    gds.cell("A").sref("B", 0, 0).sref("NOWHERE", 0, 0).end_cell();
    gds.cell("B").square(1, 0, 0, 10).sref("A", 5, 5).end_cell();
    let layout = layout(gds.end());
    assert_eq!((layout.dangling().len(), layout.circles().len()), (1, 1));
    let mut flat = Flat(Vec::new());
    let lenient = Selection {
        lenient: true,
        ..Selection::default()
    };
    layout.visit(&lenient, &mut flat, &Silent).unwrap();
    assert_eq!(flat.0.len(), 1);
}

/// Four thousand damaged files; `cargo run --release --example fuzz_reader` makes as many as you like.
#[test]
fn damaged_bytes_never_panic() {
    let mut corpus = vec![gds::everything(), gds::everything()];
    let gds = foreign_files()
        .into_iter()
        .filter(|f| f.extension().is_some_and(|e| e == "gds"));
    corpus.extend(gds.map(|f| {
        let mut bytes = std::fs::read(f).unwrap();
        if bytes.len() > 8192 {
            bytes.drain(3000..bytes.len() - 3000);
        }
        bytes
    }));
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(20_261_121);
    let readable = (0..4000)
        .filter(|_| metalith_testing::mutate::survives(&metalith_testing::mutate::mutate(&mut rng, &corpus)))
        .count();
    assert!(
        readable > 100,
        "mutants should be nearly right, or they test little: {readable}"
    );
}
