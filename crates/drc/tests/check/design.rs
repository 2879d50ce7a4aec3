//! A layout against the design it should hold.

use std::path::PathBuf;

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_drc::{CheckInput, Deck, DrcReport, Status};
use metalith_gds::Layout;
use metalith_layout::write_pillars;
use metalith_testing::gds::Gds;

use crate::{broken, input, layout};

/// A design of the size of the shipped small one, its text changed, and its flat layout.
struct Case {
    _folder: tempfile::TempDir,
    design: Design,
    file: PathBuf,
}

impl Case {
    fn new(changes: &[(&str, &str)]) -> Self {
        let shipped = metalith_testing::root().join("designs/mini_3x3.toml");
        let mut text = std::fs::read_to_string(shipped).unwrap();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mini.toml");
        std::fs::write(&path, text).unwrap();
        let design = Design::read(&path).unwrap();
        let file = folder.path().join("mini.gds");
        let array = PillarArray::build(&design, &Silent).unwrap();
        write_pillars(&design, &array, Hierarchy::Flat, &file, &Silent).unwrap();
        Self {
            _folder: folder,
            design,
            file,
        }
    }

    fn judge(&self) -> DrcReport {
        let with = CheckInput {
            design: Some(&self.design),
            ..input()
        };
        metalith_drc::check(&Layout::open(&self.file).unwrap(), &Deck::standard(), &with, &Silent).unwrap()
    }

    /// Change the bytes of the file, from the first record of the first pillar on.
    fn alter(&self, change: impl FnOnce(&mut Vec<u8>, usize)) {
        let mut bytes = std::fs::read(&self.file).unwrap();
        let head = [0, 4, 8, 0, 0, 6, 13, 2, 0, 1, 0, 6, 14, 2, 0, 0, 0, 44, 16, 3];
        let at = bytes.windows(head.len()).position(|w| w == head).unwrap();
        change(&mut bytes, at);
        std::fs::write(&self.file, bytes).unwrap();
    }
}

/// True of this design: some of the light that arrives obliquely diffracts into the glass at 400, 455, 530 and 660 nm, and into
/// the air at 400 and 455 nm.
const NOTE: (&str, u64) = ("design.lattice_orders", 6);

#[test]
fn the_shipped_small_design_holds() {
    let report = Case::new(&[]).judge();
    assert_eq!(broken(&report), [NOTE]);
    assert_eq!(report.exit_code(), 0);
}

#[test]
fn a_pillar_of_another_width_is_found() {
    let case = Case::new(&[]);
    // The first square one nanometre wider on all sides.
    case.alter(|bytes, at| {
        let place = |k: usize| at + 20 + 4 * k..at + 24 + 4 * k;
        let value = |bytes: &[u8], k| i32::from_be_bytes(bytes[place(k)].try_into().unwrap());
        let corners: Vec<i32> = (0..10).map(|k| value(bytes, k)).collect();
        for (k, &c) in corners.iter().enumerate() {
            let low = c == *corners.iter().skip(k % 2).step_by(2).min().unwrap();
            bytes[place(k)].copy_from_slice(&(c + if low { -1 } else { 1 }).to_be_bytes());
        }
    });
    assert_eq!(broken(&case.judge()), [("design.width_map", 1), NOTE]);
}

#[test]
fn a_missing_pillar_is_found() {
    const RECORDS: usize = 64;
    let case = Case::new(&[]);
    case.alter(|bytes, at| drop(bytes.drain(at..at + RECORDS)));
    assert_eq!(broken(&case.judge()), [("design.pillar_count", 1), NOTE]);
}

#[test]
fn a_phase_too_steep_for_the_lattice_is_found() {
    // The same lenses with a quarter of the focal length: numerical aperture 0.64 and wedges besides.
    let case = Case::new(&[("focal_length_um = 144", "focal_length_um = 36")]);
    let report = case.judge();
    assert_eq!(report.exit_code(), 1);
    let found = broken(&report);
    assert!(found.iter().all(|f| f.0.starts_with("design.")), "{found:?}");
    let steep = found.iter().find(|f| f.0 == "design.phase_step").unwrap();
    // Of nine elements the steered ones.
    assert!(steep.1 >= 4, "{found:?}");
}

#[test]
fn the_active_area_is_that_of_the_chip() {
    // The shipped chip is smaller than the deck's area; its marks reach to 5 um from the edge of this one.
    let case = Case::new(&[]);
    let (width, _) = case.design.layout.chip.size_nm;
    let text = std::fs::read_to_string(case.file.with_file_name("mini.toml")).unwrap();
    let size = format!("size_um = [{0}, {0}]", width / 1000);
    assert!(text.contains(&size), "{size}");
    let reach = case
        .design
        .layout
        .marks
        .iter()
        .flat_map(|m| m.centres_nm.iter().map(|c| c.0 + m.length_nm / 2));
    let tight = 2 * (reach.max().unwrap() / 1000 + 5);
    let case = Case::new(&[(&size, &format!("size_um = [{tight}, {tight}]"))]);
    assert!(broken(&case.judge()).iter().any(|f| f.0 == "layer.active_area"));
}

/// A design as it is written, by the rules of a deck.
fn as_written(design: &Design, deck: &Deck) -> DrcReport {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("pillars.gds");
    let array = PillarArray::build(design, &Silent).unwrap();
    write_pillars(design, &array, Hierarchy::Folded, &file, &Silent).unwrap();
    let with = CheckInput {
        design: Some(design),
        ..input()
    };
    metalith_drc::check(&Layout::open(&file).unwrap(), deck, &with, &Silent).unwrap()
}

/// The shipped design of a name as it is written, by the rules of squares.
fn shipped(name: &str) -> DrcReport {
    let design = Design::read(&metalith_testing::design(name)).unwrap();
    as_written(&design, &Deck::standard())
}

/// Phases of a hologram jump by turns from site to site, which no pillar shows: only what is steep in truth counts.
#[test]
fn shipped_designs_of_other_arrays_and_phases_hold() {
    for name in ["array_2x4", "mixed_lenses", "hologram"] {
        let report = shipped(name);
        let worse: Vec<_> = broken(&report).into_iter().filter(|rule| rule.0 != NOTE.0).collect();
        assert_eq!((worse, report.exit_code()), (vec![], 0), "{name}");
    }
    // Steps at the vortices of the hologram are steep.
    let report = shipped("hologram");
    let rule = rule(&report, "design.phase_step");
    let steep = rule.facts.iter().find(|(what, _)| what.ends_with("in (2, 0)"));
    let (_, share) = steep.unwrap();
    assert!(*share > 0.001 && *share < 0.01, "{share}");
}

/// A shipped design with words of its text replaced, as it is written, by the rules that are taken where none are named.
fn by_its_own_rules(name: &str, changes: &[(&str, &str)]) -> DrcReport {
    let text = metalith_testing::accepting(&metalith_testing::changed(name, changes));
    let design = Design::parse(&metalith_testing::design(name), &text).unwrap();
    as_written(&design, &Deck::for_design(&design))
}

fn rule<'a>(report: &'a DrcReport, id: &str) -> &'a metalith_drc::RuleReport {
    report.rules.iter().find(|r| r.id == id).unwrap()
}

/// Another pitch than the paper's, gaps of 30 nm: as the design has it.
#[test]
fn squares_of_another_cell_have_rules_of_their_own() {
    let squares = ("shape = \"circle\"", "shape = \"square\"");
    let report = by_its_own_rules("asi_940", &[squares, ("width_max_nm = 350", "width_max_nm = 420")]);
    assert_eq!((broken(&report), report.exit_code()), (vec![], 0));
    assert_eq!(report.deck, "Square pillars");
    assert!(rule(&report, "pillar.lattice").status == Status::Run && rule(&report, "gap.min").status == Status::Run);
    // The cell of the paper keeps its own.
    assert!(by_its_own_rules("array_2x4", &[]).deck.starts_with("SiN pillars"));
}

/// Lenses that hold no window of 31 um are clean all the same; larger ones are judged.
#[test]
fn a_window_that_fits_in_no_lens_is_not_asked_for() {
    for (diameter, runs) in [("diameter_um = 40", false), ("diameter_um = 46", true)] {
        let report = by_its_own_rules("asi_940", &[("diameter_um = 100", diameter)]);
        assert_eq!((broken(&report), report.exit_code()), (vec![], 0), "{diameter}");
        let fill = &rule(&report, "density.fill").status;
        assert_eq!(*fill == Status::Run, runs, "{fill:?}");
        assert_eq!(matches!(fill, Status::NotApplicable(_)), !runs, "{fill:?}");
        let junit = metalith_drc::junit(&report);
        let case = junit
            .lines()
            .find(|line| line.contains("name=\"density.fill\""))
            .unwrap();
        assert_eq!(case.contains("<skipped message="), !runs, "{case}");
    }
}

/// A pitch above the wavelength sends light along the normal into oblique orders of the air: no design that is clean.
#[test]
fn a_lattice_that_diffracts_over_the_pillars_is_not_clean() {
    let wide = ("width_max_nm = 350", "width_max_nm = 700");
    let report = by_its_own_rules("asi_940", &[("pitch_nm = 450", "pitch_nm = 1000"), wide]);
    let found = broken(&report);
    // Both media, at 940 nm and at the shortest wavelength of the band.
    assert!(found.contains(&("design.lattice_orders", 4)), "{found:?}");
    assert!(found.contains(&("design.orders_over_pillars", 1)), "{found:?}");
    assert_eq!(report.exit_code(), 1);
    let said = &rule(&report, "design.orders_over_pillars").markers[0].words;
    insta::assert_snapshot!(said, @"at 940.0 nm the lattice diffracts into the medium over the pillars: orders exist below 1000.0 nm along the normal");
}

/// Strips that are nearer than they are long hold every pillar of theirs, and no rule finds one of another.
#[test]
fn strips_side_by_side_hold_their_own_pillars() {
    let case = Case::new(&[
        ("diameter_um = 60", "aperture = \"rectangle\"\naperture_um = [100, 20]"),
        ("elements = [3, 3]", "elements = [1, 3]"),
        ("spacing_um = 150", "spacing_um = [150, 21]"),
    ]);
    let report = case.judge();
    let array = PillarArray::build(&case.design, &Silent).unwrap();
    assert_eq!(report.pillars_on_lattices, array.pillars());
    let of_pillars = |(id, _): &(&str, u64)| ["design.", "gap.", "lattice."].iter().any(|of| id.starts_with(of));
    let worse = broken(&report).into_iter().filter(|rule| rule.0 != NOTE.0);
    let worse: Vec<_> = worse.filter(of_pillars).collect();
    assert_eq!(worse, []);
}

/// Pillars on the rims of neighbouring lenses, in a layout that does not keep to its design: too near, sharing area, and the same.
#[test]
fn pillars_of_two_elements_are_compared() {
    let mut design = Design::read(&metalith_testing::root().join("designs/hologram.toml")).unwrap();
    // The lattice of each has 172 sites of 350 nm: the second begins so far right of where the first ends.
    let mut found = |apart_nm: i64, widths: [i32; 2], up_nm: i32| {
        for (placed, x) in design.array.placed.iter_mut().zip([0, 171 * 350 + apart_nm]) {
            placed.centre_nm = (x, 0);
        }
        let mut gds = Gds::library();
        gds.cell("CHIP").rect(10, -100_000, -100_000, 160_000, 100_000);
        let last = 171 * 175;
        gds.square(1, last, 175, widths[0]);
        gds.square(1, last + apart_nm as i32, 175 + up_nm, widths[1]);
        gds.end_cell();
        let with = CheckInput {
            design: Some(&design),
            ..input()
        };
        let report = metalith_drc::check(&layout(gds.end()), &Deck::standard(), &with, &Silent).unwrap();
        assert_eq!(report.pillars_on_lattices, 2);
        let of_gaps = broken(&report).into_iter().filter(|(id, _)| id.starts_with("gap."));
        of_gaps.map(|(id, times)| (id.to_owned(), times)).collect::<Vec<_>>()
    };
    let broken = |id: &str| (id.to_owned(), 1);
    assert_eq!(found(350, [300, 300], 0), []);
    assert_eq!(found(350, [300, 340], 0), [broken("gap.min"), broken("gap.aspect")]);
    // Diagonally, 30 nm along either axis: 42 nm.
    assert_eq!(found(350, [320, 320], 350), [broken("gap.min"), broken("gap.aspect")]);
    assert_eq!(found(250, [300, 240], 0), [broken("gap.overlap")]);
}

/// Reading ends where more rectangles than are kept stand elsewhere than the elements of the design.
#[test]
fn the_layout_of_another_design_is_not_read_whole() {
    let case = Case::new(&[]);
    let (columns, rows, pitch, corner) = (4000, 2100, 500, 1_000_000);
    let mut gds = Gds::library();
    gds.cell("PILLAR").square(1, 0, 0, 100).end_cell();
    let [right, top] = [columns, rows].map(|n: i16| corner + i32::from(n) * pitch);
    gds.cell("TOP")
        .array("PILLAR", columns, rows, [corner, corner, right, corner, corner, top]);
    std::fs::write(&case.file, gds.end_cell().end()).unwrap();
    let report = case.judge();
    assert!(rule(&report, "pillar.lattice").status != Status::Run, "{report:?}");
    assert_ne!(report.exit_code(), 0);
}
