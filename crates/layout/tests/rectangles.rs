//! Rotated rectangles: every way of writing them holds the same pillars, which are read back from any of them.

use std::path::Path;

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, extract};
use metalith_layout::{LayoutFormat, OasisEncoding, convert, extraction_plan, write_pillars_as};
use metalith_pillars::{PillarShape, RotatedRectangles};
use metalith_testing::design;

const PILLARS: RotatedRectangles = RotatedRectangles {
    width_nm: 100,
    length_nm: 250,
    steps: 180,
};

fn lens() -> Design {
    Design::read(&design("geometric_phase_532")).unwrap()
}

fn holds(path: &Path, design: &Design, array: &PillarArray) {
    let name = path.display();
    let layout = Layout::open(path).unwrap();
    for plan in [
        extraction_plan(design),
        ExtractionPlan::discover(design.layout.layers.pillars.number()),
    ] {
        let read = extract(&layout, &plan, &Silent).unwrap();
        assert_eq!(read.shape, PillarShape::Rectangle(PILLARS.into()), "{name}");
        assert_eq!((read.pillars, read.oddities.total()), (array.pillars(), 0), "{name}");
        for (element, placed) in read.elements.iter().zip(&array.placed) {
            assert_eq!(element.widths.number, array.widths(placed).number, "{name}");
        }
    }
    // Upright ones, of a rotation of none or a quarter turn, are upright rectangles and no squares.
    let squares = extraction_plan(design).of_shape(PillarShape::Square);
    let read = extract(&layout, &squares, &Silent).unwrap();
    assert_eq!((read.pillars, read.oddities.total()), (0, array.pillars()), "{name}");
}

#[test]
fn rectangles_are_read_back_from_every_hierarchy_and_format() {
    let design = lens();
    let array = PillarArray::build(&design, &Silent).unwrap();
    // Half a turn leaves a lens without wedge as it is; a mirror turns its pillars the other way.
    assert_eq!(array.classes[0].group.members().len(), 2);
    let folder = tempfile::tempdir().unwrap();
    let (gds, oasis) = (folder.path().join("pillars.gds"), folder.path().join("pillars.oas"));
    let mut folded = 0;
    for hierarchy in [Hierarchy::Folded, Hierarchy::Sref, Hierarchy::Flat] {
        let written = write_pillars_as(&design, &array, hierarchy, LayoutFormat::Gds, &gds, &Silent).unwrap();
        holds(&gds, &design, &array);
        match hierarchy {
            Hierarchy::Folded => folded = written.bytes,
            Hierarchy::Sref => assert!(folded < written.bytes * 3 / 5, "half of the references are written"),
            Hierarchy::Flat => {}
        }
    }
    for encoding in [OasisEncoding::Compact, OasisEncoding::Plain, OasisEncoding::Smallest] {
        for hierarchy in [Hierarchy::Folded, Hierarchy::Flat] {
            let format = LayoutFormat::Oasis(encoding);
            write_pillars_as(&design, &array, hierarchy, format, &oasis, &Silent).unwrap();
            holds(&oasis, &design, &array);
        }
    }
    convert(&Layout::open(&oasis).unwrap(), LayoutFormat::Gds, &gds, &Silent).unwrap();
    holds(&gds, &design, &array);
}

#[test]
fn rotations_are_half_of_the_phase_and_what_the_lattice_asks_for() {
    // Half a step of rotation, twice of phase, what the grid turns neighbouring rotations apart, and rounding.
    const HALF_STEP: f64 = 0.5 / 180.0 + 0.29 / 180.0 + 1e-9;
    for (arriving, sign) in [("left", 1.0), ("right", -1.0)] {
        let path = design("geometric_phase_532");
        let text = std::fs::read_to_string(&path).unwrap();
        let text = text.replace("arriving = \"left\"", &format!("arriving = \"{arriving}\""));
        let design = Design::parse(&path, &text).unwrap();
        let array = PillarArray::build(&design, &Silent).unwrap();
        let widths = array.widths(array.central());
        let lens = metalith_design::phase::LensPhase::of(&design);
        let phase = metalith_design::phase::ElementPhase::of(&lens, &array.central().element);
        let mut pillars = 0;
        for ((iy, ix), &number) in widths.number.indexed_iter().filter(|(_, n)| **n != 0) {
            let turns = sign * PILLARS.drawn_rotation(number) / std::f64::consts::PI;
            let wanted = phase.wrapped(ix, iy).unwrap();
            let added = design.mapping.rotation.added(std::f64::consts::TAU * wanted) / std::f64::consts::PI;
            assert!(added.abs() > 0.0 && added.abs() < 0.3 / 180.0);
            let off = turns - wanted - added;
            assert!((off - off.round()).abs() <= HALF_STEP, "({ix}, {iy}): {off}");
            pillars += 1;
        }
        assert!(pillars > 40_000 && u64::try_from(pillars).unwrap() == array.pillars());
    }
}
