//! Round pillars on a hexagonal lattice: every way of writing them holds the same ones, where the closed form has them.

use std::collections::BTreeMap;
use std::path::Path;

use metalith_core::Silent;
use metalith_design::array::Symmetry;
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{Design, Hierarchy, PillarArray, PillarRule};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, Why, extract, fits};
use metalith_layout::{LayoutFormat, extraction_plan, write_pillars_as};
use metalith_pillars::{PillarRows, PillarShape};
use metalith_testing::design;
use metalith_testing::layouts::{all_pillars, each_layout, same_pillars};

const PITCH_NM: i64 = 350;
/// Half the root of three of 350 nm is 303.11 nm.
const ROW_NM: i64 = 303;

fn text(elements: &str) -> String {
    let text = std::fs::read_to_string(design("mini_3x3")).unwrap();
    metalith_testing::accepting(&text)
        .replacen("[cell]\n", "[cell]\nshape = \"circle\"\nlattice = \"hexagonal\"\n", 1)
        .replacen("elements = [3, 3]", elements, 1)
}

/// One lens that folds by both mirrors, two that fold by one.
fn hexagonal() -> Design {
    Design::parse(&design("mini_3x3"), &text("elements = [3, 1]")).unwrap()
}

/// Pillars of an element by their places from its middle, from the positions of the lattice and the phase in closed form.
fn expected(design: &Design, element: usize) -> BTreeMap<(i64, i64), u16> {
    let lens = LensPhase::of(design);
    let element = design.elements()[element];
    let own = design.lens_of(&element);
    let outline = design.outline_of(&element);
    // Convex and counter-clockwise: inside is what is to the left of every side, or on it.
    let within = |x: i64, y: i64| {
        let corners = outline.as_ref().map_or(&[][..], |o| o.corners_nm());
        let next = corners.iter().cycle().skip(1);
        let left = |((ax, ay), (bx, by)): (&(i64, i64), &(i64, i64))| (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0;
        corners.iter().zip(next).all(left)
    };
    let phase = ElementPhase::of(&lens, &element);
    let rule = PillarRule::of_element(design, element.index);
    let lattice = design.lattice();
    let middle = lattice.sites() as i64 / 2;
    let radius2 = (own.radius_um() * 1e3).powi(2);
    let mut pillars = BTreeMap::new();
    for row in -middle..=middle {
        for k in -middle..=middle {
            let (x, y) = (k * PITCH_NM + row.rem_euclid(2) * PITCH_NM / 2, row * ROW_NM);
            if (x * x + y * y) as f64 > radius2 || !within(x, y) {
                continue;
            }
            let [ix, iy] = [middle + 2 * k + row.rem_euclid(2), middle + row].map(|i| i as usize);
            let turns = phase.wrapped(ix, iy).unwrap();
            pillars.insert((x, y), rule.width_nm(turns));
        }
    }
    pillars
}

fn holds(path: &Path, design: &Design, array: &PillarArray) {
    let name = path.display();
    fits(path, &design.sites()).unwrap();
    let found = ExtractionPlan::discover(design.layout.layers.pillars.number());
    let found = all_pillars(path, &found, array);
    let read = same_pillars(path, &extraction_plan(design), array);
    for (element, found) in read.elements.iter().zip(&found.elements) {
        let (given, known) = (&element.site, &found.site);
        assert_eq!(
            (given.centre_nm, given.lattice.kind()),
            (known.centre_nm, known.lattice.kind())
        );
        assert_eq!(given.lattice.pitch_nm(), known.lattice.pitch_nm());
        assert_eq!(element.widths.histogram()[1..], found.widths.histogram()[1..], "{name}");
    }
    for (k, element) in read.elements.iter().enumerate() {
        let lattice = element.site.lattice;
        let mut there = BTreeMap::new();
        element.widths.each_pillar(|iy, ix, width| {
            there.insert((lattice.whole_nm(0, ix), lattice.whole_nm(1, iy)), width);
        });
        assert_eq!(there, expected(design, k), "{name}");
    }
}

#[test]
fn pillars_are_read_back_from_every_hierarchy_and_format() {
    let design = hexagonal();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    each_layout(folder.path(), &design, &array, |path| holds(path, &design, &array));
}

/// Elements that are placed one by one: a round lens, a smaller one in a hexagon that is steered, and a rotated rectangle.
#[test]
fn own_lenses_and_polygons_stand_on_the_lattice() {
    let elements = "\n\
        [[element]]\nx_um = -60\ny_um = -10\n\n\
        [[element]]\nx_um = 60\ny_um = 7.35\ndiameter_um = 40\nfocal_length_um = 90\naperture = \"regular\"\n\
        aperture_sides = 6\nsteering_x_deg = 10\n\n\
        [[element]]\nx_um = 0\ny_um = 90\naperture = \"rectangle\"\naperture_um = [40, 25]\nrotation_deg = 20\n";
    let text = text("")
        .replacen("spacing_um = 150\n", "", 1)
        .replacen("steering_deg = 15 ", "# ", 1)
        .replacen("[mapping]", &format!("{elements}\n[mapping]"), 1);
    let design = Design::parse(&design("mini_3x3"), &text).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    assert_eq!(array.placed.len(), 3);
    let folder = tempfile::tempdir().unwrap();
    for hierarchy in [Hierarchy::Folded, Hierarchy::Flat] {
        let path = folder.path().join("own.gds");
        write_pillars_as(&design, &array, hierarchy, LayoutFormat::Gds, &path, &Silent).unwrap();
        let read = all_pillars(&path, &extraction_plan(&design), &array);
        for (k, element) in read.elements.iter().enumerate() {
            let lattice = element.site.lattice;
            let mut there = BTreeMap::new();
            element.widths.each_pillar(|iy, ix, width| {
                there.insert((lattice.whole_nm(0, ix), lattice.whole_nm(1, iy)), width);
            });
            assert!(there.len() > 1000);
            assert_eq!(there, expected(&design, k), "element {k}, {hierarchy:?}");
        }
    }
}

#[test]
fn a_lens_folds_by_the_mirrors_of_a_rectangle() {
    let design = hexagonal();
    let array = PillarArray::build(&design, &Silent).unwrap();
    // The middle, and one that is steered: its twin is its mirror image.
    assert_eq!(array.classes.len(), 2);
    let members = |k: usize| array.classes[array.placed[k].class].group.members().to_vec();
    let mirrors = Symmetry::ALL.into_iter().filter(|s| s.quarter_turns.is_multiple_of(2));
    let mut mirrors: Vec<_> = mirrors.collect();
    mirrors.sort_unstable();
    assert_eq!(members(1), mirrors);
    assert_eq!(members(0).len(), 2);
    // Rows of six neighbours hold more pillars than a square lattice of the same pitch: by 2 / root 3, and the rim.
    let square = text("elements = [3, 1]").replacen("lattice = \"hexagonal\"\n", "", 1);
    let square = PillarArray::build(&Design::parse(&design.path, &square).unwrap(), &Silent).unwrap();
    let more = array.pillars() as f64 / square.pillars() as f64;
    const RIM: f64 = 0.005;
    assert!((more - 350.0 / 303.0).abs() < RIM, "{more}");
    // An element that is not held has the same pillars and symmetries.
    let computed = PillarArray::build_within(&design, 0, &Silent).unwrap();
    for (a, b) in computed.placed.iter().zip(&array.placed) {
        assert_eq!((a.class, a.symmetry), (b.class, b.symmetry));
        assert_eq!(computed.widths(a), array.widths(b));
    }
    assert_eq!(computed.classes[0].group, array.classes[0].group);
}

/// A pillar between sites, as a square lattice would have it, is no pillar of the lattice.
#[test]
fn pillars_of_another_lattice_are_told() {
    let design = hexagonal();
    let square = text("elements = [3, 1]").replacen("lattice = \"hexagonal\"\n", "", 1);
    let square = Design::parse(&design.path, &square).unwrap();
    let array = PillarArray::build(&square, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("square.gds");
    write_pillars_as(&square, &array, Hierarchy::Flat, LayoutFormat::Gds, &path, &Silent).unwrap();
    let read = extract(&Layout::open(&path).unwrap(), &extraction_plan(&design), &Silent).unwrap();
    let off = read.oddities.by_why[Why::OffLattice] + read.oddities.by_why[Why::OutsideElements];
    assert_eq!(read.pillars + off, array.pillars());
    assert!(off > array.pillars() * 9 / 10, "{off}");
}

#[test]
fn squares_refuse_it() {
    let path = design("mini_3x3");
    let squares = text("elements = [3, 1]").replacen("shape = \"circle\"\n", "", 1);
    let error = Design::parse(&path, &squares).unwrap_err();
    assert_eq!(error.ids(), ["cell.lattice/inconsistent"]);
    assert_eq!(hexagonal().cell.shape, PillarShape::Circle);
    let plain = text("elements = [3, 1]").replacen("\"hexagonal\"", "\"square\"", 1);
    let without = plain.replacen("lattice = \"square\"\n", "", 1);
    let digest = |text: &str| Design::parse(&path, text).unwrap().digest();
    assert_eq!(digest(&plain), digest(&without));
    assert_ne!(digest(&plain), hexagonal().digest());
}
