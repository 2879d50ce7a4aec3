//! Layouts: the bytes they were, on any number of threads, readable by a reader that is not ours.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use metalith_core::{AtomicFile, Progress, Silent};
use metalith_design::array::ClassPillars;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_gds::{LayerNumber, Layout, LayoutError, Limit, Point, ReadLimits, Selection, Shape, Transform, Visitor};
use metalith_layout::{LayoutFormat, OasisEncoding, convert, write_apertures, write_pillars, write_pillars_as};
use metalith_oasis::{CellReference, NameTable, OasisItem, OasisLimits, OasisReader, OasisShape};
use metalith_pillars::PillarRows;
use metalith_testing::gds::Gds;
use metalith_testing::{design, golden};
use serde_json::json;

const HIERARCHIES: [(&str, Hierarchy); 3] = [
    ("folded", Hierarchy::Folded),
    ("sref", Hierarchy::Sref),
    ("flat", Hierarchy::Flat),
];

fn layout_bytes(design: &Design, hierarchy: Hierarchy, folder: &Path) -> Vec<u8> {
    let array = PillarArray::build(design, &Silent).unwrap();
    let path = folder.join("pillars.gds");
    write_pillars(design, &array, hierarchy, &path, &Silent).unwrap();
    fs::read(path).unwrap()
}

#[test]
fn golden_bytes_of_the_mini_design() {
    let folder = tempfile::tempdir().unwrap();
    let mini = Design::read(&design("mini_3x3")).unwrap();
    for (name, hierarchy) in HIERARCHIES {
        golden(
            &format!("mini_3x3/{name}.gds.gz"),
            &layout_bytes(&mini, hierarchy, folder.path()),
        );
    }
    let apertures = folder.path().join("apertures.gds");
    write_apertures(&mini, &apertures).unwrap();
    golden("mini_3x3/apertures.gds.gz", &fs::read(apertures).unwrap());
}

/// Record of a folded layout of a design, in numbers: its digest, and the number of pillars of each width or, of
/// rectangles, of each number of a rotation.
fn record(name: &str, folder: &Path) -> serde_json::Value {
    let design = Design::read(&design(name)).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let path = folder.join(name);
    let written = write_pillars(&design, &array, Hierarchy::Folded, &path, &Silent).unwrap();
    let digest = metalith_core::file::file_digest(&path).unwrap();
    fs::remove_file(path).unwrap();
    let mut widths: BTreeMap<usize, u64> = BTreeMap::new();
    for placed in &array.placed {
        let counts = array.classes[placed.class].widths.histogram();
        for (width, count) in counts.into_iter().enumerate().skip(1).filter(|(_, c)| *c > 0) {
            *widths.entry(width).or_default() += count;
        }
    }
    json!({
        "design_digest": design.digest(),
        "pillars": array.pillars(),
        "elements": array.placed.len(),
        "distinct_elements": array.classes.len(),
        "bytes": written.bytes,
        "sha256": metalith_core::text::hex(&digest),
        "widths_nm": widths,
    })
}

fn golden_records(file: &str, names: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let all: BTreeMap<&str, _> = names.iter().map(|name| (*name, record(name, folder.path()))).collect();
    golden(file, format!("{:#}\n", json!(all)).as_bytes());
}

/// The main job at full size: 57.7 and 160.3 million pillars.
#[test]
#[ignore = "second tier: full size, run by .ci/run"]
fn golden_digests_of_the_full_size_designs() {
    golden_records("full_size.json", &["prototype_3x3", "wide_5x5"]);
}

/// Circles, rotated and upright rectangles, phases over the plane, other arrays.
#[test]
fn golden_digests_of_the_other_designs() {
    let names = [
        "asi_940",
        "hexagonal_1550",
        "tio2_532",
        "geometric_phase_532",
        "birefringent_532",
        "silicon_10600",
        "hologram",
        "array_2x4",
        "mixed_lenses",
    ];
    golden_records("other_designs.json", &names);
}

/// Elements that are made row by row, as large ones are, give the bytes of those that are held: a lens of 1 mm, and
/// steered elements that are copies of one another, in every hierarchy and format.
#[test]
fn elements_that_are_not_held_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let mini = Design::read(&design("mini_3x3")).unwrap();
    let mut lens = Design::read(&design("prototype_3x3")).unwrap();
    lens.array.count = (1, 1);
    let held = |design: &Design| PillarArray::build(design, &Silent).unwrap();
    let computed = |design: &Design| PillarArray::build_within(design, 0, &Silent).unwrap();
    let bytes = |design: &Design, array: &PillarArray, hierarchy, format| {
        let path = folder.path().join("layout");
        write_pillars_as(design, array, hierarchy, format, &path, &Silent).unwrap();
        fs::read(path).unwrap()
    };
    let compact = LayoutFormat::Oasis(OasisEncoding::Compact);
    let mut cases = vec![
        (&lens, Hierarchy::Folded, LayoutFormat::Gds),
        (&lens, Hierarchy::Folded, compact),
    ];
    for (_, hierarchy) in HIERARCHIES {
        for encoding in [OasisEncoding::Compact, OasisEncoding::Plain, OasisEncoding::Smallest] {
            cases.push((&mini, hierarchy, LayoutFormat::Oasis(encoding)));
        }
        cases.push((&mini, hierarchy, LayoutFormat::Gds));
    }
    for (design, hierarchy, format) in cases {
        let (held, computed) = (held(design), computed(design));
        assert!(matches!(held.classes[0].widths, ClassPillars::Held(_)));
        assert!(matches!(computed.classes[0].widths, ClassPillars::Computed(_)));
        assert_eq!(held.pillars(), computed.pillars());
        let same = bytes(design, &held, hierarchy, format) == bytes(design, &computed, hierarchy, format);
        assert!(same, "{} {hierarchy:?} {format:?}", design.name);
    }
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let mini = Design::read(&design("mini_3x3")).unwrap();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| layout_bytes(&mini, Hierarchy::Folded, folder.path()))
    };
    let one = on(1);
    assert!(one == on(2) && one == on(5));
}

/// Steps that were promised, less those that were reported.
#[derive(Default)]
struct StepsLeft(AtomicU64);

impl Progress for StepsLeft {
    fn begin(&self, _what: &str, steps: u64) {
        self.0.store(steps, Ordering::Relaxed);
    }

    fn advance(&self, steps: u64) {
        self.0.fetch_sub(steps, Ordering::Relaxed);
    }
}

/// The time that is left of a folded layout was eight times too long: it has an eighth of its pillars.
#[test]
fn progress_ends_with_the_last_pillar_that_is_written() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["mini_3x3", "hexagonal_1550"] {
        let design = Design::read(&design(name)).unwrap();
        let array = PillarArray::build(&design, &Silent).unwrap();
        let encodings =
            [OasisEncoding::Compact, OasisEncoding::Plain, OasisEncoding::Smallest].map(LayoutFormat::Oasis);
        for (hierarchy, of) in HIERARCHIES {
            for format in [LayoutFormat::Gds].into_iter().chain(encodings) {
                let left = StepsLeft::default();
                write_pillars_as(&design, &array, of, format, &folder.path().join("pillars"), &left).unwrap();
                assert_eq!(left.0.load(Ordering::Relaxed), 0, "{name}, {hierarchy}, {format:?}");
            }
        }
    }
}

#[test]
fn another_reader_finds_every_pillar() {
    let folder = tempfile::tempdir().unwrap();
    let mini = Design::read(&design("mini_3x3")).unwrap();
    let expected = PillarArray::build(&mini, &Silent).unwrap().pillars();
    for (name, hierarchy) in HIERARCHIES {
        let bytes = layout_bytes(&mini, hierarchy, folder.path());
        let library = gds21::GdsLibrary::from_bytes(bytes).unwrap();
        let cells = library
            .structs
            .iter()
            .map(|s| (s.name.as_str(), s))
            .collect::<BTreeMap<_, _>>();
        assert_eq!(count(&cells, "MINI_3X3"), expected, "{name}");
    }
}

/// Squares on the pillar layer in a cell and all it refers to.
fn count(cells: &BTreeMap<&str, &gds21::GdsStruct>, name: &str) -> u64 {
    let mut below = BTreeMap::new();
    let mut sum = 0;
    for element in &cells[name].elems {
        match element {
            gds21::GdsElement::GdsBoundary(b) => sum += u64::from(b.layer == 1),
            gds21::GdsElement::GdsStructRef(r) => *below.entry(r.name.as_str()).or_insert(0) += 1,
            _ => {}
        }
    }
    sum + below
        .iter()
        .map(|(child, times)| times * count(cells, child))
        .sum::<u64>()
}

#[test]
fn an_unfinished_file_replaces_nothing() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kept.gds");
    fs::write(&path, "old").unwrap();
    let mut file = AtomicFile::create(&path).unwrap();
    file.write_all(&vec![0; 3_000_000]).unwrap();
    assert!(AtomicFile::create(&path).is_err(), "two writers of one file");
    drop(file);
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        1,
        "nothing is left beside it"
    );
    // What a killed run leaves is overwritten by the next.
    fs::write(folder.path().join(".kept.gds.part"), [7; 100]).unwrap();
    AtomicFile::write(&path, b"new").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"new");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

const ENCODINGS: [OasisEncoding; 3] = [OasisEncoding::Compact, OasisEncoding::Plain, OasisEncoding::Smallest];

/// OASIS in every encoding has every pillar, counted record by record, and is the same on any number of threads.
#[test]
fn oasis_has_every_pillar_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let mini = Design::read(&design("mini_3x3")).unwrap();
    let array = PillarArray::build(&mini, &Silent).unwrap();
    for encoding in ENCODINGS {
        for hierarchy in [Hierarchy::Folded, Hierarchy::Flat] {
            let on = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let path = folder.path().join("pillars.oas");
                pool.install(|| {
                    write_pillars_as(&mini, &array, hierarchy, LayoutFormat::Oasis(encoding), &path, &Silent)
                })
                .unwrap();
                fs::read(path).unwrap()
            };
            let one = on(1);
            assert!(one == on(2) && one == on(5));
            assert_eq!(count_oasis(&one), array.pillars(), "{encoding:?} {hierarchy:?}");
        }
    }
    // Plain files have one layer each, and no repetition.
    let path = folder.path().join("plain.oas");
    let written = write_pillars_as(
        &mini,
        &array,
        Hierarchy::Folded,
        LayoutFormat::Oasis(OasisEncoding::Plain),
        &path,
        &Silent,
    )
    .unwrap();
    assert_eq!(written.beside.len(), 2, "marks and outline: {:?}", written.beside);
    for path in written.beside.iter().chain([&path]) {
        let bytes = fs::read(path).unwrap();
        let mut layers = Vec::new();
        let mut reader = OasisReader::new(std::io::Cursor::new(&bytes), OasisLimits::default()).unwrap();
        loop {
            match reader.read_item().unwrap() {
                OasisItem::Element(e) => {
                    assert!(e.repetition.is_none());
                    if !matches!(e.shape, OasisShape::Placement { .. }) && !layers.contains(&e.layer) {
                        layers.push(e.layer);
                    }
                }
                OasisItem::End => break,
                _ => {}
            }
        }
        assert_eq!(layers.len(), 1, "{}", path.display());
    }
}

/// Squares on the pillar layer in the top cell and all it refers to.
fn count_oasis(bytes: &[u8]) -> u64 {
    let mut reader = OasisReader::new(std::io::Cursor::new(bytes), OasisLimits::default()).unwrap();
    fn number(reference: CellReference<'_>) -> u64 {
        match reference {
            CellReference::Number(number) => number,
            CellReference::Name(_) => panic!("strict files refer by number"),
        }
    }
    let (mut cells, mut current, mut top) = (CellCounts::new(), 0, 0);
    loop {
        match reader.read_item().unwrap() {
            OasisItem::Cell(name) => current = number(name),
            OasisItem::Element(e) => {
                let (squares, below) = cells.entry(current).or_default();
                match e.shape {
                    OasisShape::Rectangle { .. } if e.layer == 1 => *squares += e.copies,
                    OasisShape::Placement { cell, .. } => below.push((number(cell), e.copies)),
                    _ => {}
                }
            }
            OasisItem::Name(entry) if entry.table == NameTable::Cells && entry.name == b"MINI_3X3" => {
                top = entry.number;
            }
            OasisItem::End => return squares_below(&cells, top),
            _ => {}
        }
    }
}

/// Number of squares of each cell, and cells below it with their number.
type CellCounts = BTreeMap<u64, (u64, Vec<(u64, u64)>)>;

fn squares_below(cells: &CellCounts, cell: u64) -> u64 {
    let (squares, below) = &cells[&cell];
    squares + below.iter().map(|(c, n)| n * squares_below(cells, *c)).sum::<u64>()
}

/// Round trip from one format into the other: the same geometry, cell by cell, of layouts of this program and of
/// others.
#[test]
fn converted_layouts_are_the_same_geometry() {
    let folder = tempfile::tempdir().unwrap();
    let mini = Design::read(&design("mini_3x3")).unwrap();
    let array = PillarArray::build(&mini, &Silent).unwrap();
    let own = folder.path().join("own.gds");
    write_pillars(&mini, &array, Hierarchy::Folded, &own, &Silent).unwrap();
    let foreign = metalith_testing::root().join("golden/foreign");
    let mut files: Vec<_> = fs::read_dir(foreign).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    files.push(own);
    for file in files {
        let original = Layout::open(&file).unwrap();
        let (oasis, gds) = (folder.path().join("a.oas"), folder.path().join("b.gds"));
        convert(&original, LayoutFormat::Oasis(OasisEncoding::Compact), &oasis, &Silent).unwrap();
        let oasis = Layout::open(&oasis).unwrap();
        convert(&oasis, LayoutFormat::Gds, &gds, &Silent).unwrap();
        let gds = Layout::open(&gds).unwrap();
        let expected = corners(&original);
        assert!(!expected.is_empty());
        for (name, converted) in [("oasis", &oasis), ("gds", &gds)] {
            assert_eq!(
                converted.cells().len(),
                original.cells().len(),
                "{name} {}",
                file.display()
            );
            assert!(corners(converted) == expected, "{name} {}", file.display());
        }
    }
}

/// Cells of lenses, elements and pillars have names that a design may have too.
#[test]
fn a_design_may_be_called_as_one_of_its_cells() {
    let folder = tempfile::tempdir().unwrap();
    let source = design("mini_3x3");
    let text = fs::read_to_string(&source).unwrap();
    for (name, top) in [
        ("lens0", "LENS0_TOP"),
        ("lens-0", "LENS_0"),
        ("lens0-a", "LENS0_A_TOP"),
        ("e0", "E0_TOP"),
        ("w120", "W120_TOP"),
        ("r", "R"),
    ] {
        let named = text.replacen("name = \"mini_3x3\"", &format!("name = \"{name}\""), 1);
        let design = Design::parse(&source, &named).unwrap();
        let array = PillarArray::build(&design, &Silent).unwrap();
        for format in [LayoutFormat::Gds, LayoutFormat::Oasis(OasisEncoding::Plain)] {
            for (_, hierarchy) in HIERARCHIES {
                let path = folder.path().join("pillars");
                let written = write_pillars_as(&design, &array, hierarchy, format, &path, &Silent).unwrap();
                let layout = Layout::open(&path).unwrap();
                assert_eq!(written.top_cell, top);
                assert!(layout.doubled().is_empty() && layout.tops().len() == 1, "{name}");
            }
        }
    }
}

/// Steps that are no whole units are written one by one.
#[test]
fn an_array_of_a_billion_copies_on_one_place_is_not_converted() {
    let folder = tempfile::tempdir().unwrap();
    let mut gds = Gds::library();
    gds.cell("TOP")
        .array("A", 32767, 32767, [0, 0, 100, 0, 0, 100])
        .end_cell();
    gds.cell("A").square(1, 0, 0, 10).end_cell();
    let layout = Layout::from_bytes("array.gds", gds.end(), ReadLimits::default()).unwrap();
    let path = folder.path().join("array.oas");
    let format = LayoutFormat::Oasis(OasisEncoding::Plain);
    let error = convert(&layout, format, &path, &Silent).unwrap_err();
    let behind = std::error::Error::source(&error).and_then(|s| s.downcast_ref::<metalith_gds::Error>());
    let cause = behind.and_then(metalith_gds::Error::in_layout).map(|(_, cause)| cause);
    let limit = Limit::FlatShapesOfShortFile;
    assert!(
        matches!(cause, Some(LayoutError::Limit { limit: found, .. }) if *found == limit),
        "{error:?}"
    );
    assert!(!path.exists());
}

/// A few bytes that would become a file of any size are refused before anything is written.
#[test]
fn bombs_are_not_converted() {
    let many = [0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x3F];
    // A cell A with 2^62 x 2^62 squares on one place.
    let records = [
        b"\x0e\x01A\x14\xdf\x01\x00\x0a\x00\x00\x01".as_slice(),
        &many,
        &many,
        &[0, 0],
    ]
    .concat();
    let bytes = metalith_testing::oasis::around(&records);
    let layout = Layout::from_bytes("bomb.oas", bytes, ReadLimits::default()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.gds");
    assert!(convert(&layout, LayoutFormat::Gds, &out, &Silent).is_err() && !out.exists());
}

/// Layers and corners of all areas where they stand, in one order.
fn corners(layout: &Layout) -> Vec<(LayerNumber, Vec<Point>)> {
    struct Areas(Vec<(LayerNumber, Vec<Point>)>);
    impl Visitor for Areas {
        fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
            for placement in placements {
                let mut corners = shape.outline.placed(placement);
                corners.sort_unstable();
                corners.dedup();
                self.0.push((shape.layer, corners));
            }
            Ok(())
        }
    }
    let mut areas = Areas(Vec::new());
    layout.visit(&Selection::default(), &mut areas, &Silent).unwrap();
    areas.0.sort_unstable();
    areas.0
}
