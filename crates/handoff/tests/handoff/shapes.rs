//! Hand-offs of round pillars and of rotated rectangles: what stands in their tables is what stands in their files.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_4;
use std::path::{Path, PathBuf};

use metalith_core::{Progress, Result, Silent};
use metalith_design::{Design, PillarArray};
use metalith_gds::{
    LayerNumber, Layout, Point, Rect, Selection, Shape, Transform, Visitor, circle_of, tilted_rectangle_of,
};
use metalith_handoff::{DesignSource, HandoffOptions, HandoffSource, LayoutStatistics, handoff, verify_handoff};
use metalith_pillars::{DatabaseUnit, LatticeKind, PillarId, PillarRows, PillarShape, Rectangles};
use metalith_testing::{design, root};
use metalith_wave::Accuracy;

use super::{PILLARS, SUMMED, TABLE_S, options, rows_in, source};

/// Largest distance of a polygon from its circle where a design says nothing (nm), and the rounding of its corners.
const CHORD_NM: f64 = 0.5;
const ROUNDED_NM: f64 = 0.7072;

/// Half a digit of the last decimal of a table (nm).
const PLACE_NM: i64 = 1;

/// A hand-off by the process of the program that etches the film.
fn made(name: &str) -> PathBuf {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}_shapes"));
    let _ = std::fs::remove_dir_all(&out);
    let options = HandoffOptions {
        source: HandoffSource::Design(DesignSource {
            path: design(name),
            fidelity: None,
            accuracy: Accuracy::Fast,
            compensate: None,
            dose_classes: None,
        }),
        process: None,
        command: format!("metalith handoff designs/{name}.toml"),
        ..options(&out)
    };
    let made = handoff(&options, &Silent).unwrap();
    for check in &made.checks {
        assert_eq!(check.verdict.word(), "pass", "{name}: {}: {}", check.name, check.words);
    }
    assert!(verify_handoff(&out, &Silent).unwrap().holds());
    out
}

/// Outlines of a layer as they are placed, by twice their middle (nm).
struct Outlines {
    found: BTreeMap<(i64, i64), Vec<Point>>,
}

impl Visitor for Outlines {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        for placement in placements {
            let points = shape.outline.placed(placement);
            let ends = |of: fn(&Point) -> i64| {
                let all = points.iter().map(of);
                all.clone().min().unwrap() + all.max().unwrap()
            };
            self.found.insert((ends(|p| p.x), ends(|p| p.y)), points);
        }
        Ok(())
    }
}

fn outlines(file: &Path, layer: LayerNumber) -> BTreeMap<(i64, i64), Vec<Point>> {
    let mut visitor = Outlines { found: BTreeMap::new() };
    let selection = Selection {
        layers: Some(vec![layer]),
        ..Default::default()
    };
    let progress: &dyn Progress = &Silent;
    Layout::open(file)
        .unwrap()
        .visit(&selection, &mut visitor, progress)
        .unwrap();
    visitor.found
}

/// Area of a closed outline (nm^2).
fn area(points: &[Point]) -> f64 {
    let twice: i64 = points.windows(2).map(|w| w[0].x * w[1].y - w[1].x * w[0].y).sum();
    twice.abs() as f64 / 2.0
}

/// True if an outline is the pillar that a row of a table says is drawn.
fn is_drawn(outline: &[Point], row: &BTreeMap<String, String>, shape: PillarShape) -> bool {
    match shape {
        PillarShape::Mixed => false,
        PillarShape::Square => unreachable!("other tests look at squares"),
        PillarShape::Circle => circle_of(outline, 1.0).is_some_and(|r| r.width().to_string() == row["drawn_nm"]),
        PillarShape::Rectangle(Rectangles::Upright(_)) => {
            let number = |key: &str| row[key].parse::<i64>().unwrap();
            let around = Rect::around(outline);
            outline.len() == 5 && (around.width(), around.height()) == (number("drawn_x_nm"), number("drawn_y_nm"))
        }
        PillarShape::Rectangle(Rectangles::Rotated(_)) => {
            let number = |key: &str| row[key].parse::<f64>().unwrap();
            let drawn = metalith_pillars::RotatedRectangles {
                width_nm: number("drawn_width_nm") as u16,
                length_nm: number("drawn_length_nm") as u16,
                steps: 180,
            };
            let tilted = tilted_rectangle_of(outline, 1.0).unwrap();
            tilted.number(drawn.into(), 1.0) == Some(drawn.number(number("drawn_rotation_deg").to_radians()))
        }
    }
}

/// Tables of a hand-off agree with its files: what they say of pillars is found there; areas are those of the shapes,
/// and times follow.
fn tables_hold(name: &str, sites: usize, pads: usize) {
    let folder = made(name);
    let design = Design::read(&design(name)).unwrap();
    let (shape, array) = (design.cell.shape, PillarArray::build(&design, &Silent).unwrap());
    let file = folder.join(format!("layout/{name}_pillars.gds"));
    let pillars = outlines(&file, PILLARS);
    assert_eq!(pillars.len() as u64, array.pillars());

    let at = |row: &BTreeMap<String, String>| {
        let twice = |key: &str| (row[key].parse::<f64>().unwrap() * 2e3).round() as i64;
        (twice("x_um"), twice("y_um"))
    };
    let table = rows_in(&folder, "metrology/cd_table.csv");
    let on_lenses: Vec<_> = table.iter().filter(|row| row["file"] == "pillars").collect();
    assert_eq!(on_lenses.len(), sites);
    for row in on_lenses {
        assert!(is_drawn(&pillars[&at(row)], row, shape), "{row:?}");
    }

    // The area drawn is the sum over all outlines, to the last square nanometre; and that of the shapes but for chords and the grid.
    let census = LayoutStatistics::take(&file, &Silent).unwrap();
    let counted = census.layer(1, 0).unwrap();
    let drawn: f64 = pillars.values().map(|p| area(p)).sum::<f64>() * 1e-6;
    assert!((counted.area_um2 - drawn).abs() < SUMMED * drawn);
    let counts = array.classes[0].widths.histogram();
    let each = counts.iter().enumerate().skip(1);
    let (ideal, off) = each.fold((0.0, 0.0), |(ideal, off), (w, &n)| {
        let (area_nm2, around_nm) = match shape {
            PillarShape::Rectangle(_) => {
                let [a, b] = shape.edges_nm(PillarId(w as u16)).map(f64::from);
                (a * b, 2.0 * (a + b))
            }
            _ => (FRAC_PI_4 * (w * w) as f64, 4.0 * FRAC_PI_4 * w as f64),
        };
        (
            ideal + n as f64 * area_nm2,
            off + n as f64 * around_nm * (CHORD_NM + ROUNDED_NM),
        )
    });
    assert!((drawn * 1e6 - ideal).abs() < off, "{drawn} um2, {} um2", ideal * 1e-6);
    let times = rows_in(&folder, "dose/write_time.csv");
    let two_na = times
        .iter()
        .find(|t| t["file"] == format!("{name}_pillars.gds") && t["current_na"] == "2");
    let expected_s = 280e-6 * drawn * 1e-8 / 2e-9;
    assert!((two_na.unwrap()["beam_s"].parse::<f64>().unwrap() - expected_s).abs() < TABLE_S);

    // Uniform pads: each holds the pillar of the table alone, on the lattice of the design or one so many times as wide. All of a
    // pad within its side less half a pitch and half a row is a site.
    let tests = outlines(&folder.join(format!("tests/{name}_tests_pillars.gds")), PILLARS);
    let mut seen = 0;
    for row in rows_in(&folder, "tests/structures.csv") {
        let dense = row["id"].starts_with('D');
        if !(dense || row["id"].starts_with('S')) || row["purpose"].starts_with("solid") {
            continue;
        }
        let nm = |key: &str| (row[key].parse::<f64>().unwrap() * 1e3).round() as i64;
        let [x0, y0, x1] = ["x0_um", "y0_um", "x1_um"].map(nm);
        let inside =
            |&(x, y): &(i64, i64)| (2 * x0..=2 * x1).contains(&x) && (2 * y0..=2 * (y0 + x1 - x0)).contains(&y);
        let pad: Vec<_> = tests.iter().filter(|(place, _)| inside(place)).collect();
        let apart = |axis: usize| {
            let mut all: Vec<i64> = pad.iter().map(|(place, _)| [place.0, place.1][axis]).collect();
            all.sort_unstable();
            all.dedup();
            let steps: Vec<i64> = all.windows(2).map(|w| w[1] - w[0]).collect();
            assert!(steps.iter().all(|s| (s - steps[0]).abs() <= PLACE_NM), "{row:?}");
            (steps[0], all.len() as i64)
        };
        let ((x_step, columns), (y_step, rows)) = (apart(0), apart(1));
        let pitch = (design.cell.pitch_nm.nm() as i64) * if dense { 1 } else { 3 };
        match design.cell.lattice {
            LatticeKind::Square => {
                let across = (x1 - x0) / pitch;
                assert_eq!([x_step, y_step], [2 * pitch; 2]);
                assert_eq!(pad.len() as i64, across * across, "{row:?}");
            }
            LatticeKind::Hexagonal => {
                // Places are doubled, so half a pitch is one; sparse ones are wider by the even rows that they have.
                assert!((pitch..pitch + 10).contains(&x_step) && (dense || y_step % 4 == 0));
                assert_eq!(
                    y_step,
                    2 * LatticeKind::Hexagonal.row_nm((x_step as u32).into(), DatabaseUnit::Nanometre) as i64
                );
                let (half, side) = (columns / 2 * x_step, x1 - x0);
                assert!((side - 2 * x_step..=side).contains(&(half + x_step)), "{row:?}");
                assert!((2 * side - 3 * y_step..=2 * side).contains(&(rows * y_step)), "{row:?}");
                // Every other place of the grid, whichever the corners are.
                assert!((2 * pad.len() as i64 - columns * rows).abs() <= 1, "{row:?}");
            }
        }
        assert!(pad.iter().all(|(_, outline)| is_drawn(outline, &row, shape)), "{row:?}");
        seen += 1;
    }
    assert_eq!(seen, 2 * pads);

    // Nine blocks, alike but for their dose.
    let matrix = LayoutStatistics::take(&folder.join(format!("dose/{name}_dose_matrix.gds")), &Silent).unwrap();
    let first = matrix.layer(20, 1).unwrap();
    let a_pad = (0.95 * 60_f64.powi(2) / design.lattice().cell_um2()) as u64;
    assert!(first.shapes > 3 * a_pad);
    for dose in 2..=9 {
        let block = matrix.layer(20, dose).unwrap();
        assert_eq!(block.shapes, first.shapes);
        assert!((block.area_um2 - first.area_um2).abs() < SUMMED * first.area_um2);
    }
}

/// Four of five diameters in three rings: the widest is beyond what the mapping writes.
#[test]
fn round_pillars_are_handed_over() {
    tables_hold("asi_940", 12, 11);
}

/// A hexagonal lattice, with the process for its thicker film: pads are two arrays each, and sites have six neighbours.
#[test]
fn a_hexagonal_lattice_is_handed_over() {
    tables_hold("hexagonal_1550", 14, 8);
}

/// A film that is thicker than etch and rules are for is refused; without a process there is one for it.
#[test]
fn a_process_for_another_thickness_is_refused() {
    let process = root().join("processes/jbx6300_asi.toml");
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("thicker");
    let options = HandoffOptions {
        source: source(&design("hexagonal_1550")),
        process: Some(process),
        ..options(&out)
    };
    let error = handoff(&options, &Silent).unwrap_err();
    assert_eq!(error.id(), "handoff/film-thickness-differs");
    insta::assert_snapshot!(error, @"
    the film of the design is 900 nm thick; `film_nm` in [transfer] of process jbx6300_asi in jbx6300_asi.toml is 400 to 700 nm, for which its etch and its rules are
      help: use a process file for this thickness; if its etch and its rules are right for it, change `film_nm` in [transfer]
    ");
    assert!(!out.exists());
}

/// Four rotations in three rings but for one that a ring has none of; six rotations and four sizes of pads.
#[test]
fn rotated_rectangles_are_handed_over() {
    tables_hold("geometric_phase_532", 11, 10);
}

/// Five sizes in three rings, two of which a ring has none of; five pads.
#[test]
fn upright_rectangles_are_handed_over() {
    tables_hold("birefringent_532", 13, 5);
}

/// A process that has no rules for a shape says so, before anything is written.
#[test]
fn a_process_without_rules_for_a_shape_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let shipped = root().join("processes/jbx6300_asi.toml");
    let rules = std::fs::canonicalize(root().join("rules")).unwrap();
    let text = std::fs::read_to_string(shipped).unwrap();
    let text = text
        .replace("[checks.circles]", "[checks.rectangles]")
        .replace("../rules", rules.to_str().unwrap());
    let process = folder.path().join("process.toml");
    std::fs::write(&process, text).unwrap();
    let out = folder.path().join("out");
    let options = HandoffOptions {
        source: source(&design("asi_940")),
        process: Some(process),
        ..options(&out)
    };
    let error = handoff(&options, &Silent).unwrap_err();
    assert_eq!(error.id(), "handoff/no-rules-for-pillars");
    insta::assert_snapshot!(error, @r#"
    the pillars are circles, and [checks] of process jbx6300_asi in process.toml has no decks of rules for them
      help: copy process.toml within its folder, add a section [checks.circles] with `pillar_rules = "../rules/circles.toml"`, `dose_rules = "../rules/dose_circles.toml"` and `test_rules = "../rules/test_circles.toml"`, and give the copy to --process
    "#);
    assert!(!out.exists());
}
