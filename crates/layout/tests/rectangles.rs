//! Rotated rectangles: every way of writing them holds the same pillars, which are read back from any of them.

use std::path::Path;

use metalith_core::Silent;
use metalith_design::{Design, PillarArray};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, extract};
use metalith_layout::extraction_plan;
use metalith_pillars::{PillarShape, RotatedRectangles};
use metalith_testing::design;
use metalith_testing::layouts::{each_layout, same_pillars};

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
    let found = ExtractionPlan::discover(design.layout.layers.pillars.number());
    for plan in [extraction_plan(design), found] {
        let read = same_pillars(path, &plan, array);
        assert_eq!(read.shape, PillarShape::Rectangle(PILLARS.into()), "{name}");
    }
    // Upright ones, of a rotation of none or a quarter turn, are upright rectangles and no squares.
    let squares = extraction_plan(design).of_shape(PillarShape::Square);
    let read = extract(&Layout::open(path).unwrap(), &squares, &Silent).unwrap();
    assert_eq!((read.pillars, read.oddities.total()), (0, array.pillars()), "{name}");
}

#[test]
fn rectangles_are_read_back_from_every_hierarchy_and_format() {
    let design = lens();
    let array = PillarArray::build(&design, &Silent).unwrap();
    // Half a turn leaves a lens without wedge as it is; a mirror turns its pillars the other way.
    assert_eq!(array.classes[0].group.members().len(), 2);
    let folder = tempfile::tempdir().unwrap();
    each_layout(folder.path(), &design, &array, |path| holds(path, &design, &array));
    let bytes = |name: &str| std::fs::metadata(folder.path().join(name)).unwrap().len();
    // Half of the references are written.
    assert!(bytes("Folded.gds") < bytes("Sref.gds") * 3 / 5);
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
