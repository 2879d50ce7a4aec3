//! Round pillars: every way of writing them holds the same circles, which are read back from any of them.

use std::path::Path;

use metalith_core::Silent;
use metalith_design::{Design, PillarArray};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, Why, extract};
use metalith_pillars::PillarShape;
use metalith_testing::design;
use metalith_testing::layouts::{each_layout, same_pillars};

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
    let found = ExtractionPlan::discover(design.layout.layers.pillars.number());
    for plan in [plan(design, PillarShape::Circle), found] {
        assert_eq!(same_pillars(path, &plan, array).shape, PillarShape::Circle, "{name}");
    }
    let layout = Layout::open(path).unwrap();
    let squares = extract(&layout, &plan(design, PillarShape::Square), &Silent).unwrap();
    assert_eq!(squares.pillars, 0, "{name}");
    assert_eq!(squares.oddities.by_why[Why::OtherShape], array.pillars(), "{name}");
}

#[test]
fn circles_are_read_back_from_every_hierarchy_and_format() {
    let design = circles();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    each_layout(folder.path(), &design, &array, |path| holds(path, &design, &array));
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
