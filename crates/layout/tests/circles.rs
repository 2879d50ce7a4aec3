//! Round pillars: every way of writing them holds the same circles, which are read back from any of them.

use std::path::Path;

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, Why, extract};
use metalith_layout::{LayoutFormat, OasisEncoding, write_pillars_as};
use metalith_pillars::PillarShape;
use metalith_testing::design;

fn circles() -> Design {
    let path = design("mini_3x3");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = metalith_testing::accepting(&text).replacen("[cell]\n", "[cell]\nshape = \"circle\"\n", 1);
    // One lens that folds by all symmetries, two that fold by one.
    let text = text.replacen("elements = [3, 3]", "elements = [3, 1]", 1);
    Design::parse(&path, &text).unwrap()
}

fn plan(design: &Design, shape: PillarShape) -> ExtractionPlan {
    ExtractionPlan::given(design.layout.layers.pillars.number(), design.sites()).of_shape(shape)
}

fn holds(path: &Path, design: &Design, array: &PillarArray) {
    let name = path.display();
    let layout = Layout::open(path).unwrap();
    for plan in [
        plan(design, PillarShape::Circle),
        ExtractionPlan::discover(design.layout.layers.pillars.number()),
    ] {
        let read = extract(&layout, &plan, &Silent).unwrap();
        assert_eq!(read.shape, PillarShape::Circle, "{name}");
        assert_eq!((read.pillars, read.oddities.total()), (array.pillars(), 0), "{name}");
        for (element, placed) in read.elements.iter().zip(&array.placed) {
            assert_eq!(element.widths.number, array.widths(placed).number, "{name}");
        }
    }
    let squares = extract(&layout, &plan(design, PillarShape::Square), &Silent).unwrap();
    assert_eq!(squares.pillars, 0, "{name}");
    assert_eq!(
        squares.oddities.by_why[Why::OtherShape as usize],
        array.pillars(),
        "{name}"
    );
}

#[test]
fn circles_are_read_back_from_every_hierarchy_and_format() {
    let design = circles();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for hierarchy in [Hierarchy::Folded, Hierarchy::Sref, Hierarchy::Flat] {
        let path = folder.path().join("circles.gds");
        write_pillars_as(&design, &array, hierarchy, LayoutFormat::Gds, &path, &Silent).unwrap();
        holds(&path, &design, &array);
    }
    for encoding in [OasisEncoding::Compact, OasisEncoding::Plain, OasisEncoding::Smallest] {
        let path = folder.path().join("circles.oas");
        let format = LayoutFormat::Oasis(encoding);
        write_pillars_as(&design, &array, Hierarchy::Folded, format, &path, &Silent).unwrap();
        holds(&path, &design, &array);
    }
}

#[test]
fn squares_have_the_digest_that_they_had() {
    let circles = circles();
    let squares = Design::parse(
        &circles.path,
        &std::fs::read_to_string(&circles.path)
            .unwrap()
            .replacen("[cell]\n", "[cell]\nshape = \"square\"\n", 1),
    )
    .unwrap();
    let plain = Design::read(&circles.path).unwrap();
    assert_eq!(squares.digest(), plain.digest());
    assert_ne!(squares.digest(), circles.digest());
}
