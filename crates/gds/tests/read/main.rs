//! The reader and the extraction: hand-built bytes, files of other tools, random trees, damaged bytes.

mod folded;
mod oasis;
mod trees;

use std::path::PathBuf;

use metalith_core::{Lattice, LatticeKind, PillarShape, Rectangles, Silent, WidthMap};
use metalith_gds::extract::{ElementSite, ExtractionPlan, Why, extract};
use metalith_gds::{
    Error, LayerNumber, Layout, LayoutError, Limit, Point, ReadLimits, Rect, Selection, Shape, Transform, Visitor,
};
use metalith_testing::gds::{self, Gds};
use rand::SeedableRng;

const PILLARS: LayerNumber = LayerNumber { layer: 1, datatype: 0 };

fn layout(bytes: Vec<u8>) -> Layout {
    Layout::from_bytes("test.gds", bytes, ReadLimits::default()).unwrap()
}

fn fault_of(bytes: Vec<u8>) -> (u64, String) {
    match Layout::from_bytes("test.gds", bytes, ReadLimits::default()).map(|_| ()) {
        Err(Error::Layout { offset, cause, .. }) => (offset, cause.to_string()),
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

/// The lens of `scripts/make_foreign_layouts.py`.
fn foreign_lens() -> (ElementSite, WidthMap) {
    let lattice = Lattice::new(350, 24).unwrap();
    let mut widths = WidthMap::empty(lattice);
    for ((iy, ix), w) in widths.width_nm.indexed_iter_mut() {
        let h2 = lattice.half_radius2(ix, iy);
        if h2 <= 24 * 24 {
            *w = (100 + 2 * (7 * h2 % 101)) as u16;
        }
    }
    let site = ElementSite {
        name: "lens".into(),
        centre_nm: [5000, -3000],
        lattice,
    };
    (site, widths)
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

/// gdstk and KLayout, flat, referenced, mirrored, magnified, in arrays, as paths, in other units: one lens.
#[test]
fn files_of_other_tools_hold_the_same_lens() {
    let (site, widths) = foreign_lens();
    for path in foreign_files() {
        let layout = Layout::open(&path).unwrap();
        for plan in [
            ExtractionPlan::given(PILLARS, vec![site.clone()]),
            ExtractionPlan::discover(PILLARS),
        ] {
            let read = extract(&layout, &plan, &Silent).unwrap();
            let name = path.display();
            assert_eq!(read.oddities.total(), 0, "{name}: {:?}", read.oddities);
            assert_eq!(read.elements.len(), 1, "{name}");
            assert_eq!(read.elements[0].site.centre_nm, site.centre_nm, "{name}");
            assert_eq!(read.elements[0].widths, widths, "{name}");
            assert_eq!((read.pillars, read.top.as_str()), (widths.pillars(), "TOP"), "{name}");
            let layers: Vec<_> = read
                .survey
                .layers
                .iter()
                .map(|l| (l.layer.layer, l.shapes, l.texts))
                .collect();
            assert_eq!(layers, [(1, widths.pillars(), 0), (2, 1, 0), (10, 0, 1)], "{name}");
            assert_eq!(read.survey.texts[0].at_nm, [5000.0, -3000.0], "{name}");
            assert_eq!(
                read.survey.layers[1].bounds_nm,
                Some([0.0, -8000.0, 10_000.0, 2000.0]),
                "{name}"
            );
        }
    }
}

/// The polygon of a circle about a place, closed.
fn circle_of_points(x: i32, y: i32, diameter: u32) -> Vec<(i32, i32)> {
    let corners = metalith_core::circle_corners(diameter, 0.5);
    let closed = corners.iter().chain(corners.first());
    closed.map(|&(dx, dy)| (x + dx as i32, y + dy as i32)).collect()
}

/// Circles of two diameters on a lattice, and one square among them.
#[test]
fn circles_are_pillars_where_most_are() {
    let mut gds = Gds::library();
    gds.cell("TOP");
    for k in 0..36 {
        let (x, y) = (175 + 350 * (k % 6) - 1050, 175 + 350 * (k / 6) - 1050);
        if k == 7 {
            gds.square(1, x, y, 200);
        } else {
            gds.polygon(1, &circle_of_points(x, y, if k % 2 == 0 { 200 } else { 120 }));
        }
    }
    gds.end_cell();
    let file = layout(gds.end());
    let read = extract(&file, &ExtractionPlan::discover(PILLARS), &Silent).unwrap();
    assert_eq!(read.shape, PillarShape::Circle);
    assert_eq!((read.elements.len(), read.pillars), (1, 35));
    let widths = &read.elements[0].widths.width_nm;
    assert_eq!((widths[[0, 0]], widths[[0, 1]], widths[[1, 1]]), (200, 120, 0));
    assert_eq!(read.oddities.listed[0].why, Why::OtherShape);
    // Taken for squares, they are none.
    let squares = ExtractionPlan::discover(PILLARS).of_shape(PillarShape::Square);
    let read = extract(&file, &squares, &Silent).unwrap();
    assert_eq!((read.pillars, read.oddities.total()), (1, 35));
}

/// Rectangles in a cell that is drawn twice as large as it is placed.
#[test]
fn rectangles_of_a_magnified_cell_are_found_as_large_as_they_are() {
    let drawn = Rectangles {
        width_nm: 180,
        length_nm: 480,
        steps: 180,
    };
    let mut gds = Gds::library();
    gds.cell("TOP").placed("LENS", 0, 0, false, 0.5, 0.0).end_cell();
    gds.cell("LENS");
    for k in 0..36 {
        let (x, y) = (2 * (175 + 350 * (k % 6) - 1050), 2 * (175 + 350 * (k / 6) - 1050));
        let corners = drawn.corners(1 + 5 * k as u16);
        let closed = corners.iter().chain(corners.first());
        let points: Vec<(i32, i32)> = closed.map(|&(dx, dy)| (x + dx as i32, y + dy as i32)).collect();
        gds.polygon(1, &points);
    }
    gds.end_cell();
    let read = extract(&layout(gds.end()), &ExtractionPlan::discover(PILLARS), &Silent).unwrap();
    let PillarShape::Rectangle(found) = read.shape else {
        panic!("{:?}", read.shape)
    };
    assert_eq!((found.width_nm, found.length_nm), (90, 240));
    assert_eq!((read.elements.len(), read.pillars), (1, 36));
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
    assert!(fault_of(drawn(-200, 2.0)).1.contains("absolute"));
}

/// One of each oddity, and each for the right reason, at the right place.
#[test]
fn everything_that_is_not_a_pillar_is_listed() {
    let mut gds = Gds::library();
    gds.cell("TOP");
    gds.square(1, 175, 175, 100).square(1, 175, 175, 120); // doubled
    gds.square(1, 526, 175, 100); // off lattice
    gds.rect(1, -225, 125, -125, 227); // not square
    gds.polygon(1, &[(0, 600), (100, 600), (50, 700), (0, 600)]); // odd
    gds.square(1, 9000, 0, 100); // outside
    gds.square(1, -175, -175, 360); // too wide
    let circle = circle_of_points(-525, 175, 100);
    gds.polygon(1, &circle); // a circle among squares
    gds.square(2, 0, 0, 100); // on another layer
    // A square with two vertices more than it needs is one.
    gds.polygon(
        1,
        &[
            (-225, 475),
            (-175, 475),
            (-125, 475),
            (-125, 575),
            (-200, 575),
            (-225, 575),
            (-225, 475),
        ],
    );
    gds.end_cell();
    let site = ElementSite {
        name: "e".into(),
        centre_nm: [0, 0],
        lattice: Lattice::new(350, 4).unwrap(),
    };
    let read = extract(&layout(gds.end()), &ExtractionPlan::given(PILLARS, vec![site]), &Silent).unwrap();
    assert_eq!(read.oddities.by_why, [1; 7]);
    let whys: Vec<_> = read.oddities.listed.iter().map(|o| o.why).collect();
    assert_eq!(
        whys,
        [
            Why::DuplicateSite,
            Why::OffLattice,
            Why::NotSquare,
            Why::OddShape,
            Why::OutsideElements,
            Why::TooWide,
            Why::OtherShape
        ]
    );
    assert_eq!(read.oddities.listed[1].centre_nm, [526.0, 175.0]);
    assert_eq!(read.oddities.listed[2].size_nm, [100.0, 102.0]);
    assert_eq!(read.pillars, 2);
    assert_eq!(read.elements[0].widths.width_nm[[2, 2]], 100);
    assert_eq!(read.elements[0].widths.width_nm[[3, 1]], 100);
}

/// Several lenses, found without being told, one of them a mirrored and magnified copy.
/// A hexagonal lattice as people draw one: an array of every other row, then an array of the rows between. The same rows without
/// those between are no hexagonal lattice, and as many shapes are found as are drawn.
#[test]
fn two_arrays_are_one_hexagonal_lattice() {
    let rows = |between: bool| {
        let mut gds = Gds::library();
        gds.cell("P").square(1, 0, 0, 300).end_cell();
        let place = |gds: &mut Gds, x: i32, y: i32, columns: i16, rows: i16| {
            let ends = [x + 700 * i32::from(columns), y, x, y + 1212 * i32::from(rows)];
            gds.array("P", columns, rows, [x, y, ends[0], ends[1], ends[2], ends[3]]);
        };
        gds.cell("TOP");
        place(&mut gds, -28_000, -29_088, 81, 49);
        if between {
            place(&mut gds, -28_350, -28_482, 82, 48);
        }
        gds.end_cell();
        extract(&layout(gds.end()), &ExtractionPlan::discover(PILLARS), &Silent)
    };
    let found = rows(true).unwrap();
    let [element] = &found.elements[..] else {
        panic!("{} elements", found.elements.len())
    };
    assert_eq!(element.site.lattice.kind(), LatticeKind::Hexagonal);
    assert_eq!((element.site.lattice.pitch_nm(), element.site.centre_nm), (700, [0, 0]));
    assert_eq!(element.widths.pillars(), 81 * 49 + 82 * 48);
    if let Ok(other) = rows(false) {
        assert!(other.elements.iter().all(|e| e.site.lattice.is_square()));
    }
}

#[test]
fn elements_are_discovered() {
    let read = extract(&layout(gds::everything()), &ExtractionPlan::discover(PILLARS), &Silent).unwrap();
    let found: Vec<_> = read
        .elements
        .iter()
        .map(|e| (e.site.centre_nm, e.site.lattice.pitch_nm(), e.widths.pillars()))
        .collect();
    assert_eq!(
        found,
        [
            ([196_500, -3500], 700, 100),
            ([1750, 1750], 350, 100),
            // Five columns, four rows: the lattice is square, its row to spare on top.
            ([100_700, 100_700], 350, 20),
            ([1750, 301_750], 350, 100),
            ([71_750, 301_750], 350, 100),
        ]
    );
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
        let (offset, what) = fault_of(whole[..cut].to_vec());
        assert!(offset <= cut as u64, "{what}");
    }
    let head = Gds::library().0.len() as u64;
    let mut odd = Gds::library();
    odd.cell("A").record(0x08, 0, &[0]).end_cell();
    let (offset, what) = fault_of(odd.end());
    assert_eq!(offset, head + 28 + 6);
    assert!(what.contains("length 5"), "{what}");
    let mut unknown = Gds::library();
    unknown.record(0x77, 0, &[]);
    assert_eq!(fault_of(unknown.end()).0, head);
    let mut unended = Gds::library();
    unended.cell("A").empty(0x08).int2(0x0D, &[1]).end_cell();
    assert!(fault_of(unended.end()).1.contains("ENDEL is missing"));
    let mut bare = Gds::library();
    bare.cell("A")
        .empty(0x08)
        .int4(0x10, &[0, 0, 1, 0, 1, 1, 0, 0])
        .empty(0x11);
    assert!(fault_of(bare.end_cell().end()).1.contains("without LAYER"));
    assert!(fault_of(b"%PDF-1.4 not a layout".to_vec()).1.contains("HEADER"));
}

#[test]
fn faults_of_the_tree_are_found_before_anything_is_expanded() {
    let visit = |bytes: Vec<u8>| {
        let error = layout(bytes).visit(&Selection::default(), &mut Flat(Vec::new()), &Silent);
        error.unwrap_err().to_string()
    };
    let mut dangling = Gds::library();
    dangling.cell("A").sref("NOWHERE", 0, 0).end_cell();
    assert!(visit(dangling.end()).contains("NOWHERE, which is not in the file"));
    let mut circle = Gds::library();
    circle.cell("A").sref("B", 0, 0).end_cell();
    circle.cell("B").sref("C", 0, 0).end_cell();
    circle.cell("C").sref("B", 0, 0).square(1, 0, 0, 10).end_cell();
    assert!(visit(circle.end()).contains("which contains it"));
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
    let error = layout.visit(&Selection::default(), &mut Flat(Vec::new()), &Silent);
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("shapes with all references followed")
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
    let most = ReadLimits::default().flat_text_bytes;
    let limit = Limit::FlatTexts;
    assert_eq!(
        visited(&layout(bomb.end())),
        Err(LayoutError::Limit { limit, found, most })
    );
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
    assert_eq!(
        error.to_string(),
        "cell TOP refers to B\\u{a}, which is not in the file"
    );
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
